"""Runs of a workspace: listing, finding and comparing them."""
