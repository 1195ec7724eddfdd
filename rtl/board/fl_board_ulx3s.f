// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sources of the board top fl_board_ulx3s. Paths count from this file: -F fl_board_ulx3s.f.
-F ../fl_soc.f

// Declarations of the vendor's primitives; the vendor's own tool brings them itself.
vendor/EHXPLLL.sv
vendor/OSCG.sv
vendor/USRMCLK.sv

// fl_sinc3: for a board with sigma-delta modulators, no top uses it yet.
fl_pll_reset.sv
fl_adc_serial.sv
fl_adc_fault.sv
fl_sinc3.sv
fl_board.sv
fl_board_ulx3s.sv
