# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""All families of figures: importing this registers them."""

from fluxverify.figures import blac, five_phase, six_step

__all__ = ["blac", "five_phase", "six_step"]
