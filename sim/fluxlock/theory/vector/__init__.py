# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Theory of vector control at a low sampling ratio: exact model, current controllers, observer, phase-locked loop.

Source: Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, PhD
thesis, University of Sheffield, 2020, chapter 7. Vectors are complex, d + jq, amplitude-invariant; angles are
electrical (rad unless named deg), errors are estimate less truth. The sampling ratio is f_s / f_e.
"""
