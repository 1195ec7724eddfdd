# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score: small defects are put into a block one at a time, and the block's own tests must find them."""
