"""Search: features of the grammar, predicates that separate states, and top-down enumeration of loop guards."""
