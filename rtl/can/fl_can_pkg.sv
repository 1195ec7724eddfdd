// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Types of the CAN controller. On the wire, on the pins and in level signals 0 is dominant, 1 recessive.
package fl_can_pkg;

  // Bit timing in time quanta: 1 quantum synchronisation segment, propagation segment and phase segment 1 together,
  // phase segment 2. Every field holds its value less 1.
  typedef struct packed {
    logic [3:0] sjw;    // synchronisation jump width, quanta
    logic [3:0] tseg2;  // phase segment 2, quanta
    logic [5:0] tseg1;  // propagation segment and phase segment 1, quanta
    logic [7:0] brp;    // clocks a quantum
  } can_timing_t;

  typedef struct packed {
    logic        ext;   // extended identifier
    logic        rtr;   // remote frame
    logic [28:0] id;    // a standard identifier is in bits 10..0, the others 0
    logic [3:0]  dlc;   // as on the wire; above 8 there are 8 bytes
    logic [63:0] data;  // first byte in bits 7..0; bytes beyond the length are 0 when received
  } can_frame_t;

  // Acceptance filter: a frame matches where every bit of mask that is 1 is equal in it and here.
  typedef struct packed {
    logic        enable;
    logic        match_ext;
    logic        ext;
    logic        match_rtr;
    logic        rtr;
    logic [28:0] mask;
    logic [28:0] id;
  } can_filter_t;

  // What the receive FIFO keeps of a frame.
  typedef struct packed {
    logic        lost;    // frames between the one before and this were lost to a full FIFO
    logic [2:0]  filter;  // the first that matched
    logic [31:0] stamp;   // the clock after the sample point of the start of frame
    can_frame_t  frame;
  } can_entry_t;

  typedef enum logic [2:0] {
    CanNone  = 3'd0,
    CanBit   = 3'd1,  // sent one level, saw the other
    CanStuff = 3'd2,  // six equal bits
    CanForm  = 3'd3,  // dominant in a field that is always recessive
    CanAck   = 3'd4,  // nobody acknowledged
    CanCrc   = 3'd5
  } can_error_e;

  // What a bit does to the error counters; at most one is set.
  typedef struct packed {
    logic tx_add8;
    logic tx_less1;
    logic rx_add1;
    logic rx_add8;
    logic rx_less1;
    logic quiet11;   // in bus-off, eleven recessive bits in a row
  } can_count_t;

  // One bit of the cyclic redundancy check, x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
  function automatic logic [14:0] crc15(logic [14:0] crc, logic data);
    return {crc[13:0], 1'b0} ^ ((crc[14] ^ data) ? 15'h4599 : 15'h0);
  endfunction

endpackage
