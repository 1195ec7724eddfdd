# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the drive shows and takes, as data: the tables of `sw/drive`, and the C and the pages made from them."""
