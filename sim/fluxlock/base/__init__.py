# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What everything stands on: places, Ctrl-C, progress, files that are written. Imports nothing else of ours."""
