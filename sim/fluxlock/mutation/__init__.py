"""Mutation score: small defects are put into a block one at a time, and the block's own tests must find them."""
