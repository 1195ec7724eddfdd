// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Request side of the register bus: what the interconnect sends to every block, with a strobe of its own for each.
package fl_bus_pkg;

  localparam int unsigned WindowWidth = 12;  // one window of 4 KiB a block

  typedef struct packed {
    logic we;
    logic [WindowWidth-1:0] adr;  // byte address inside the block's window
    logic [31:0] wdat;
    logic [3:0] sel;  // byte lanes
  } bus_req_t;

endpackage
