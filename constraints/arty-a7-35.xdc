# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

# Arty A7-35 (XC7A35TICSG324-1L): pins and timing of fl_board_arty. Pin table: docs/blocks/fl_board_arty.md.
set_property CFGBVS VCCO [current_design]
set_property CONFIG_VOLTAGE 3.3 [current_design]
create_clock -name clk_100mhz -period 10.000 [get_ports {clk_100mhz_i}]
# 50 MHz behind the PLL.
set chip_clock [get_clocks -of_objects [get_pins u_pll/CLKOUT0]]
# Oscillator of the configuration logic: 65 MHz + 50 %. Only single levels pass between it and the chip's clock.
create_clock -name oscillator -period 10.256 [get_pins u_startup/CFGMCLK]
set_clock_groups -asynchronous -group $chip_clock -group [get_clocks oscillator]

# Asynchronous inputs, each passes a synchroniser; outputs whose timing does not matter.
set_false_path -from [get_ports {reset_button_ni fault_pin_i hall_i[*] encoder_i[*] uart_rx_i can_rx_i}]
set_false_path -to [get_ports {brake_o driver_enable_o uart_tx_o can_tx_o led_o[*]}]

# Converters: select and clock are at the pads within 10 ns of the clock edge (20 ns - 10 ns).
set_output_delay -clock $chip_clock -max 10.0 [get_ports {adc_cs_no adc_sclk_o}]
set_output_delay -clock $chip_clock -min 0.0 [get_ports {adc_cs_no adc_sclk_o}]
# A bit is taken 40 ns, two clocks, after the edge that asked for it. It is at the pad after at most 10 ns (above), 7 ns
# (level shifter and board, both ways) and 15 ns (t4 of the part): 12 ns after the clock edge between, 8 ns before the one
# that takes it. It stays for at least 5 ns (t7) after the edge that takes it, which asks for the next bit too.
set_input_delay -clock $chip_clock -max 12.0 [get_ports {adc_sdata_i[*]}]
set_input_delay -clock $chip_clock -min 5.0 [get_ports {adc_sdata_i[*]}]

# Gates: all edges within 10 ns of the clock edge, so that two of them differ by less than the shortest dead time, 40 ns.
set_output_delay -clock $chip_clock -max 10.0 [get_ports {gate_h_o[*] gate_l_o[*]}]
set_output_delay -clock $chip_clock -min 0.0 [get_ports {gate_h_o[*] gate_l_o[*]}]

# Pull-ups: a fault pin and data lines without a board read as faults. Pull-downs: no Hall sensor, no encoder reads 0.

set_property -dict { PACKAGE_PIN E3 IOSTANDARD LVCMOS33 } [get_ports {clk_100mhz_i}]
set_property -dict { PACKAGE_PIN C2 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {reset_button_ni}]
set_property -dict { PACKAGE_PIN V12 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {adc_cs_no}]
set_property -dict { PACKAGE_PIN V10 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {adc_sclk_o}]
set_property -dict { PACKAGE_PIN E15 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[0]}]
set_property -dict { PACKAGE_PIN E16 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[1]}]
set_property -dict { PACKAGE_PIN D15 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[2]}]
set_property -dict { PACKAGE_PIN C15 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[3]}]
set_property -dict { PACKAGE_PIN J17 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[4]}]
set_property -dict { PACKAGE_PIN J18 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[5]}]
set_property -dict { PACKAGE_PIN K15 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[6]}]
set_property -dict { PACKAGE_PIN J15 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[7]}]
set_property -dict { PACKAGE_PIN U12 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {adc_sdata_i[8]}]
set_property -dict { PACKAGE_PIN G13 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_h_o[0]}]
set_property -dict { PACKAGE_PIN B11 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_h_o[1]}]
set_property -dict { PACKAGE_PIN A11 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_h_o[2]}]
set_property -dict { PACKAGE_PIN D13 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_l_o[0]}]
set_property -dict { PACKAGE_PIN B18 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_l_o[1]}]
set_property -dict { PACKAGE_PIN A18 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {gate_l_o[2]}]
set_property -dict { PACKAGE_PIN K16 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {brake_o}]
set_property -dict { PACKAGE_PIN F3 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {driver_enable_o}]
set_property -dict { PACKAGE_PIN D12 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {fault_pin_i}]
set_property -dict { PACKAGE_PIN D4 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {hall_i[0]}]
set_property -dict { PACKAGE_PIN D3 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {hall_i[1]}]
set_property -dict { PACKAGE_PIN F4 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {hall_i[2]}]
set_property -dict { PACKAGE_PIN E2 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {encoder_i[0]}]
set_property -dict { PACKAGE_PIN D2 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {encoder_i[1]}]
set_property -dict { PACKAGE_PIN H2 IOSTANDARD LVCMOS33 PULLTYPE PULLDOWN } [get_ports {encoder_i[2]}]
set_property -dict { PACKAGE_PIN A9 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {uart_rx_i}]
set_property -dict { PACKAGE_PIN D10 IOSTANDARD LVCMOS33 DRIVE 4 } [get_ports {uart_tx_o}]
set_property -dict { PACKAGE_PIN U14 IOSTANDARD LVCMOS33 PULLTYPE PULLUP } [get_ports {can_rx_i}]
set_property -dict { PACKAGE_PIN V14 IOSTANDARD LVCMOS33 DRIVE 8 } [get_ports {can_tx_o}]
set_property -dict { PACKAGE_PIN H5 IOSTANDARD LVCMOS33 DRIVE 4 } [get_ports {led_o[0]}]
set_property -dict { PACKAGE_PIN J5 IOSTANDARD LVCMOS33 DRIVE 4 } [get_ports {led_o[1]}]
set_property -dict { PACKAGE_PIN T9 IOSTANDARD LVCMOS33 DRIVE 4 } [get_ports {led_o[2]}]
set_property -dict { PACKAGE_PIN T10 IOSTANDARD LVCMOS33 DRIVE 4 } [get_ports {led_o[3]}]
