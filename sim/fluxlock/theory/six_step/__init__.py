# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Theory of six-step operation as functions: freewheeling, stability of the crossing loop, spectra, linearity.

Source: Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, PhD
thesis, University of Sheffield, 2020; equations are quoted by chapter. Angles are electrical. `n` is the number of
carriers a sector, (5.2).
"""
