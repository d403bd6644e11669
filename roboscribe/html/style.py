"""How everything looks, in light and dark; only what stands within an element of class `roboscribe` is touched."""

from __future__ import annotations

STYLE = """
.roboscribe { color-scheme: light dark; --ink: #1c2330; --soft: #5b6576; --line: #d9dee7; --paper: #ffffff;
  --panel: #f5f7fa; --accent: #2563c9; --good: #1a7f4b; --bad: #c0392b; --mark: #fff1c2; --loop: #fff6dc;
  --keyword: #8a2be2; --controller: #0b6bcb; --predicate: #0c7a5b; --number: #b3541e; --field: #6b5b95;
  --run0: #2563c9; --run1: #c2571a; --run2: #1a7f4b; --run3: #8a2be2; --run4: #b0305c; --run5: #5b6576;
  color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
@media (prefers-color-scheme: dark) { .roboscribe { --ink: #e4e8ef; --soft: #9aa5b6; --line: #343c4a;
  --paper: #14181f; --panel: #1c222c; --accent: #6ea8ff; --good: #54c78a; --bad: #ff8373; --mark: #4a3d12;
  --loop: #332c17; --keyword: #c79bff; --controller: #7db7ff; --predicate: #6fd6b0; --number: #ffab70; --field: #b8a9e0;
  --run0: #6ea8ff; --run1: #ffab70; --run2: #54c78a; --run3: #c79bff; --run4: #ff8fb3; --run5: #9aa5b6; } }
.roboscribe .code { background: var(--panel); border: 1px solid var(--line); border-radius: 8px; padding: .8em 1em;
  margin: 0; font: 14px/1.65 "DejaVu Sans Mono", ui-monospace, Menlo, Consolas, monospace; }
.roboscribe .code .row { display: block; white-space: pre-wrap; overflow-wrap: anywhere; min-height: 1.65em;
  padding-left: calc(var(--in, 0) * 1ch + 4ch); text-indent: -4ch; }
.roboscribe .code .marked { background: var(--mark); border-radius: 3px; }
.roboscribe .keyword { color: var(--keyword); font-weight: 600; } .roboscribe .controller { color: var(--controller); }
.roboscribe .predicate { color: var(--predicate); } .roboscribe .number { color: var(--number); }
.roboscribe .field { color: var(--field); } .roboscribe .comment { color: var(--soft); font-style: italic; }
.roboscribe .operator { color: var(--soft); } .roboscribe .robot { font-weight: 600; }
.roboscribe [data-tip] { cursor: help; position: relative; border-radius: 3px; }
.roboscribe [data-tip]:hover, .roboscribe [data-tip]:focus { outline: none; background: var(--line); }
.roboscribe [data-tip]:hover::after, .roboscribe [data-tip]:focus::after { content: attr(data-tip); position: absolute;
  left: 0; top: 1.6em; z-index: 9; width: max-content; max-width: 24rem; padding: .45em .7em; border-radius: 6px;
  background: var(--ink); color: var(--paper); font: 13px/1.4 system-ui, sans-serif; text-indent: 0;
  white-space: pre-wrap; pointer-events: none; }
.roboscribe table { border-collapse: collapse; font-size: 14px; }
.roboscribe th { text-align: left; font-weight: 600; color: var(--soft); vertical-align: bottom; }
.roboscribe th, .roboscribe td { padding: .3em .8em .3em 0; border-bottom: 1px solid var(--line); }
.roboscribe td, .roboscribe tbody th { vertical-align: top; } .roboscribe thead abbr { cursor: help; }
.roboscribe .right { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.roboscribe .ranked td:nth-child(2), .roboscribe .ranked .why { min-width: 15rem; }
.roboscribe .formula { font: 13px/1.5 "DejaVu Sans Mono", ui-monospace, Menlo, Consolas, monospace; }
.roboscribe .chosen td { background: var(--mark); } .roboscribe .passed td { color: var(--soft); }
.roboscribe .why { color: var(--soft); font-size: 13px; }
.roboscribe .wide { overflow-x: auto; max-width: 100%; }
.roboscribe svg { display: block; max-width: 100%; height: auto; }
.roboscribe svg text { fill: var(--ink); font: 12px system-ui, sans-serif; }
.roboscribe svg .formula { font: 12px "DejaVu Sans Mono", ui-monospace, Menlo, Consolas, monospace; }
.roboscribe svg .soft { fill: var(--soft); } .roboscribe svg .frame { stroke: var(--line); fill: none; }
.roboscribe .box { fill: var(--panel); stroke: var(--soft); } .roboscribe .box.loop { fill: var(--loop); }
.roboscribe .edge { stroke: var(--soft); fill: none; } .roboscribe .tip { fill: var(--soft); }
.roboscribe svg.strips { width: 100%; height: auto; background: var(--panel); border: 1px solid var(--line);
  border-radius: 6px; }
.roboscribe .strips .shown { fill: var(--line); } .roboscribe .strips .holds { fill: var(--accent); }
.roboscribe .strips .goal { fill: var(--bad); }
.roboscribe .axis { display: flex; justify-content: space-between; color: var(--soft); font-size: 13px; }
.roboscribe .legend { color: var(--soft); font-size: 13px; display: flex; gap: 1.2em; flex-wrap: wrap; }
.roboscribe .legend i { display: inline-block; width: .9em; height: .9em; border-radius: 2px; margin-right: .4em;
  vertical-align: -.1em; }
@media (max-width: 640px) {
  .roboscribe .code { font-size: 12.5px; padding: .6em .5em; }
  .roboscribe .code .row { padding-left: calc(var(--in, 0) * 1ch + 2ch); text-indent: -2ch; }
  .roboscribe [data-tip]:hover::after, .roboscribe [data-tip]:focus::after { position: fixed; inset: auto .8rem .8rem;
    width: auto; max-width: none; } }
@media print { .roboscribe details > * { display: block; } }
"""
"""For a `<style>` element; colours of runs are `--run0` to `--run5`."""

RUN_COLOURS = 6


def run_colour(rank: int) -> str:
    """Name the colour of the run at a rank, for `style` attributes."""
    return f"var(--run{rank % RUN_COLOURS})"


def standalone(fragment: str) -> str:
    """Wrap a fragment so that it can stand alone, as notebooks show it."""
    return f'<div class="roboscribe"><style>{STYLE}</style>{fragment}</div>'
