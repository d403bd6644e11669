"""Programs written by hand: answers that must be judged right, and near misses that must be judged wrong."""

from __future__ import annotations

RIGHT = {
    "place-one": """
def P(μ : EE):
  b := get(λb:block. true)
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    "tower": """
def P(μ : EE):
  while (b := get(λb:block. ¬at(b) ∧ ¬∃o:block. g(o)↓z < g(b)↓z ∧ ¬at(o))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    "nearest-to-the-hand": """
def P(μ : EE):
  while (b := get(λb:block. ¬at(b) ∧ ¬∃o:block. ‖μ↓xz − o↓xz‖ < ‖μ↓xz − b↓xz‖ ∧ ¬at(o))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    "turn-place-three": """
def P(μ : EE):
  while (b := get(λb:block. ¬at(b))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_turn(μ, b, g(b)) until ‖b↓angle − g(b)↓angle‖ < 0.06
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    "drawer-closed-again": """
def P(μ : EE):
  d := get(λd:drawer. true)
  π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
  π_open(μ, d) until d↓extension > 0.16
  while (c := get(λc:cube. ¬at(c))) ≠ null:
    π_hold(μ, c) until ‖μ↓xz − c↓xz‖ < 0.02
    π_at(μ, c, g(c)) until at(c)
  π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
  π_close(μ, d) until d↓extension < 0.05
where
  at(c) ≡ ‖c↓xz − g(c)↓xz‖ < 0.02
""",
    "mug-drawer-faucet-initial": """
def P(μ : EE):
  m := get(λm:mug. true)
  c := get(λc:coaster. true)
  d := get(λd:drawer. true)
  f := get(λf:faucet. true)
  π_hold(μ, m) until ‖μ↓xz − m↓xz‖ < 0.02
  π_on(μ, m, c) until ‖m↓xz − c↓xz‖ < 0.03
  π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
  π_open(μ, d) until d↓extension − d↓initial_extension > 0.125
  π_tap(μ, f) until ‖μ↓xz − f↓xz‖ < 0.02
  π_turn(μ, f) until f↓angle − f↓initial_angle > 0.85
""",
    "three-in-any-order": """
def P(μ : EE):
  f := get(λf:faucet. true)
  m := get(λm:mug. true)
  d := get(λd:drawer. true)
  π_tap(μ, f) until ‖μ↓xz − f↓xz‖ < 0.02
  π_turn(μ, f, g(f)) until ‖f↓angle − g(f)↓angle‖ < 0.06
  π_hold(μ, m) until ‖μ↓xz − m↓xz‖ < 0.02
  π_at(μ, m, g(m)) until ‖m↓xz − g(m)↓xz‖ < 0.02
  π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
  π_open(μ, d, g(d)) until ‖d↓extension − g(d)↓extension‖ < 0.012
""",
    "peg-cube-by-height": """
def P(μ : EE):
  p := get(λp:peg. true)
  c := get(λc:cube. true)
  if ¬(g(c)↓z < g(p)↓z):
    π_hold(μ, p) until ‖μ↓xz − p↓xz‖ < 0.02
    π_at(μ, p, g(p)) until ‖p↓xz − g(p)↓xz‖ < 0.02
    π_hold2(μ, c) until ‖μ↓xz − c↓xz‖ < 0.02
    π_at2(μ, c, g(c)) until ‖c↓xz − g(c)↓xz‖ < 0.02
  else:
    π_hold2(μ, c) until ‖μ↓xz − c↓xz‖ < 0.02
    π_at2(μ, c, g(c)) until ‖c↓xz − g(c)↓xz‖ < 0.02
    π_hold(μ, p) until ‖μ↓xz − p↓xz‖ < 0.02
    π_at(μ, p, g(p)) until ‖p↓xz − g(p)↓xz‖ < 0.02
""",
    "sort-by-colour": """
def P(μ : EE):
  l := get(λl:left. true)
  r := get(λr:right. true)
  while (b := get(λb:block. b↓colour < 0.5 ∧ ¬(‖b↓xz − l↓xz‖ < 0.07))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_left(μ, b, l) until ‖b↓xz − l↓xz‖ < 0.07
  while (b := get(λb:block. b↓colour > 0.5 ∧ ¬(‖b↓xz − r↓xz‖ < 0.07))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_right(μ, b, r) until ‖b↓xz − r↓xz‖ < 0.07
""",
    "sort-into-three": """
def P(μ : EE):
  l := get(λl:left. true)
  m := get(λm:middle. true)
  r := get(λr:right. true)
  while (b := get(λb:block. b↓weight < 0.5 ∧ ¬(‖b↓xz − l↓xz‖ < 0.07))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_left(μ, b, l) until ‖b↓xz − l↓xz‖ < 0.07
  while (b := get(λb:block. b↓weight > 0.5 ∧ b↓weight < 1.5 ∧ ¬(‖b↓xz − m↓xz‖ < 0.07))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_middle(μ, b, m) until ‖b↓xz − m↓xz‖ < 0.07
  while (b := get(λb:block. b↓weight > 1.5 ∧ ¬(‖b↓xz − r↓xz‖ < 0.07))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_right(μ, b, r) until ‖b↓xz − r↓xz‖ < 0.07
""",
    "left-or-right": """
def P(μ : EE):
  l := get(λl:left. true)
  r := get(λr:right. true)
  b := get(λb:block. true)
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  if b↓colour < 0.5:
    π_left(μ, b, l) until ‖b↓xz − l↓xz‖ < 0.07
  else:
    π_right(μ, b, r) until ‖b↓xz − r↓xz‖ < 0.07
""",
    "clutter-all-but-one": """
def P(μ : EE):
  b := get(λb:block. ¬(‖b↓xz − g(b)↓xz‖ < 0.02))
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02
""",
}
"""A right program by task."""

WRONG = (
    (
        "by-weight",
        "admits others",
        """
def P(μ : EE):
  while (b := get(λb:block. ¬at(b))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    ),
    (
        "place-two",
        "refuses some",
        """
def P(μ : EE):
  while (b := get(λb:block. ¬at(b) ∧ ¬∃o:block. o↓x < b↓x ∧ ¬at(o))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    ),
    (
        "place-two",
        "where a loop over block",
        """
def P(μ : EE):
  π_near(μ) until ∃o:block. ‖μ↓xz − o↓xz‖ < 0.07
  while (b := get(λb:block. ¬at(b))) ≠ null:
    π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
    π_at(μ, b, g(b)) until at(b)
where
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    ),
    (
        "place-one",
        "3 controllers for block",
        """
def P(μ : EE):
  b := get(λb:block. true)
  π_near(μ, b) until ‖μ↓xz − b↓xz‖ < 0.07
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    ),
    (
        "clutter-all-but-one",
        "succeeds in only",
        """
def P(μ : EE):
  b := get(λb:block. true)
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02
""",
    ),
    (
        "turn-place-one",
        "nothing serves block",
        """
def P(μ : EE):
  b := get(λb:block. true)
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.02
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02 ∧ b↓angle > 9
""",
    ),
    (
        "loop-then-button",
        "where a loop over block",
        """
def P(μ : EE):
  button := get(λbutton:button. true)
  π_near(μ, button) until ‖μ↓xz − button↓xz‖ < 0.02
  π_press(μ, button) until button↓pressed > 0.5
  while (block := get(λblock:block. ¬at(block))) ≠ null:
    π_hold(μ, block) until ‖μ↓xz − block↓xz‖ < 0.02
    π_at(μ, block, g(block)) until at(block)
where
  at(block) ≡ ‖block↓xz − g(block)↓xz‖ < 0.02
""",
    ),
    (
        "peg-cube-by-height",
        "order that the initial state asks for",
        """
def P(μ : EE):
  p := get(λp:peg. true)
  c := get(λc:cube. true)
  π_hold(μ, p) until ‖μ↓xz − p↓xz‖ < 0.02
  π_at(μ, p, g(p)) until ‖p↓xz − g(p)↓xz‖ < 0.02
  π_hold2(μ, c) until ‖μ↓xz − c↓xz‖ < 0.02
  π_at2(μ, c, g(c)) until ‖c↓xz − g(c)↓xz‖ < 0.02
""",
    ),
    (
        "two-in-any-order",
        "a condition where none is needed",
        """
def P(μ : EE):
  m := get(λm:mug. true)
  d := get(λd:drawer. true)
  if m↓x < d↓x:
    π_hold(μ, m) until ‖μ↓xz − m↓xz‖ < 0.02
    π_at(μ, m, g(m)) until ‖m↓xz − g(m)↓xz‖ < 0.02
    π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
    π_open(μ, d, g(d)) until ‖d↓extension − g(d)↓extension‖ < 0.012
  else:
    π_handle(μ, d) until ‖μ↓xz − d↓xz‖ < 0.02
    π_open(μ, d, g(d)) until ‖d↓extension − g(d)↓extension‖ < 0.012
    π_hold(μ, m) until ‖μ↓xz − m↓xz‖ < 0.02
    π_at(μ, m, g(m)) until ‖m↓xz − g(m)↓xz‖ < 0.02
""",
    ),
)
"""Task, part of the reason, and a program that is wrong for it."""
