"""Programs, trees, tables and time strips as HTML: for reports and notebooks, without scripts, every text escaped.

`style` is what all of it needs once on a page. `code` shows programs, `tree` abstractions, `tables` what was ranked,
`strips` where predicates hold along demonstrations, `curves` how success grew.
"""
