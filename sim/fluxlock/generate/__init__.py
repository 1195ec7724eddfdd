# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is generated before a build: register blocks, memory images, sine tables, the soft core."""
