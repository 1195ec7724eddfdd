// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sources of the board top fl_board_arty. Paths count from this file: -F fl_board_arty.f.
-F ../fl_soc.f

// Declarations of the vendor's primitives; the vendor's own tool brings them itself.
vendor/BUFG.sv
vendor/PLLE2_BASE.sv
vendor/STARTUPE2.sv

// fl_sinc3: for a board with sigma-delta modulators, no top uses it yet.
fl_pll_reset.sv
fl_adc_serial.sv
fl_adc_fault.sv
fl_sinc3.sv
fl_board.sv
fl_board_arty.sv
