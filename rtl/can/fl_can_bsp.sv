// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// CAN bit stream processor (ISO 11898-1): one step a sampled bit, sends and receives standard and extended, data and
// remote frames; arbitration, stuffing, CRC, acknowledgement, error and overload frames, bus integration.
//
// State and outputs say which field the next sampled bit belongs to; tx_o is the level sent in that bit.
// Transmission: with tx_request_i in the bit before a start of frame, tx_start_o pulses and tx_frame_i must stay as it is
// from the clock after it to tx_sent_o or tx_stop_o (arbitration lost, error, bus-off). A dominant third bit of the intermission
// is taken as the start of frame of this node's own frame too.
// Reception: rx_valid_o with rx_frame_o after the last but one bit of the end of frame. Reserved bits and the substitute
// remote bit are received at either level. With loopback_i the transmitter acknowledges and receives its own frames.
// Errors: error_o with the bit that shows it, count_o with the bit that moves a counter; passive_i and bus_off_i are the
// state before that bit. No overload frame is sent for want of time, only in answer.
//
// All outputs but tx_o, hard_o and rx_frame_o are pulses within sample_i. Latency: sample_i to tx_o 1 clock. What a bit
// decides is made ready in the clock after the bit before it: samples must be at least 2 clocks apart.
// enable_i low: recessive, then waits for eleven recessive bits. Settings must not change while enable_i.
`default_nettype none
module fl_can_bsp
  import fl_can_pkg::*;
(
    input logic clk_i,
    input logic rst_i,
    input logic enable_i,
    input logic loopback_i,

    input  logic sample_i,
    input  logic bit_i,
    output logic tx_o,
    output logic hard_o,  // an edge may restart the bit that begins next

    input logic passive_i,
    input logic bus_off_i,

    input  logic       tx_request_i,
    input  can_frame_t tx_frame_i,
    output logic       tx_start_o,
    output logic       tx_sent_o,
    output logic       tx_stop_o,

    output logic       sof_o,       // a frame begins with this bit
    output logic       rx_valid_o,
    output can_frame_t rx_frame_o,

    output can_error_e error_o,
    output can_count_t count_o
);

  typedef enum logic [4:0] {
    StIntegrate,  // eleven recessive bits
    StBusOff,
    StIdle,
    StSof,        // of this node
    StBase,       // identifier, 11 bits
    StRtr,        // remote bit, substitute remote bit of an extended frame
    StIde,
    StExtId,      // 18 bits
    StExtRtr,
    StR1,
    StR0,
    StDlc,
    StData,
    StCrc,
    StCrcDel,
    StAck,
    StAckDel,
    StEof,
    StInter,      // three bits
    StSuspend,    // eight bits after an error passive node's own frame
    StFlag,       // active error flag
    StPassive,    // passive error flag
    StOverload,   // overload flag
    StWait,       // recessive until the bus is
    StDelim       // second to eighth bit of a delimiter
  } state_e;

  state_e state_d, state_q;
  logic [5:0] count_d, count_q;  // bits of this field before the next one
  logic tx, tx_q;  // level of the bit that is sampled next
  logic transmitter_d, transmitter_q;  // of the last frame
  can_frame_t frame_d, frame_q;
  logic sof_q;
  logic [14:0] crc_d, crc_q;
  logic crc_bad_d, crc_bad_q;
  logic [2:0] run_d, run_q;  // equal bits in a row, of level last_q
  logic last_d, last_q;
  logic ack_held_d, ack_held_q;  // an error passive transmitter's missing acknowledgement is not counted yet
  logic first_d, first_q;  // the next bit is the first after an error flag

  // Fields in which bits are stuffed; the last one's stuff bit may follow in the delimiter's place.
  function automatic logic stuffed(state_e state);
    unique case (state)
      StBase, StRtr, StIde, StExtId, StExtRtr, StR1, StR0, StDlc, StData, StCrc: return 1'b1;
      default: return 1'b0;
    endcase
  endfunction

  function automatic logic arbitrates(state_e state, logic ext);
    unique case (state)
      StBase, StRtr: return 1'b1;
      StIde, StExtId, StExtRtr: return ext;
      default: return 1'b0;
    endcase
  endfunction

  // Eight bits of a longer field as a transmitter sends them, the first one on top.
  function automatic logic [7:0] eight(state_e state, logic [2:0] number, logic ext, logic [28:0] id, logic [3:0] dlc,
                                       logic [63:0] data);
    logic [15:0] base;
    logic [23:0] rest;
    base = {ext ? id[28:18] : id[10:0], 5'd0};
    rest = {id[17:0], 6'd0};
    unique case (state)
      StBase:  return number[0] ? base[7:0] : base[15:8];
      StExtId: return number[1] ? rest[7:0] : number[0] ? rest[15:8] : rest[23:16];
      StDlc:   return {dlc, 4'd0};
      default: return data[8*number+:8];
    endcase
  endfunction

  // Last value of the counter in a field.
  function automatic logic [5:0] last_count(state_e state, logic [3:0] dlc);
    unique case (state)
      StIntegrate, StBusOff, StBase:   return 6'd10;
      StExtId:                         return 6'd17;
      StDlc:                           return 6'd3;
      StData:                          return dlc[3] ? 6'd63 : {dlc[2:0] - 3'd1, 3'd7};  // eight bytes: 0 - 1 = 7
      StCrc:                           return 6'd14;
      StEof:                           return 6'd6;
      StInter:                         return 6'd2;
      StSuspend, StWait, StDelim:      return 6'd7;
      default:                         return 6'd5;  // of the flags; the others have one bit
    endcase
  endfunction

  // What follows from the state alone, one clock behind it.
  typedef struct packed {
    logic       stuffed;     // the field has stuff bits
    logic       stuff_bit;   // the next bit is one
    logic       arbitrates;  // the field decides who sends on
    logic       last;        // bit of the field
    logic       last_but_one;
    logic [5:0] count;       // of the bit after
  } view_t;

  // Bits of the frame that are sent alone or first, but for the identifier's: needed a bit after the start of frame.
  typedef struct packed {
    logic ext;
    logic rtr;
    logic rest;  // of the identifier's 18 bits
    logic dlc;
    logic data;
  } early_t;

  view_t view_d, view_q;
  early_t early_q;
  logic checked;  // sent by this node, may not differ: not in arbitration, or dominant

  always_comb begin
    view_d.stuffed      = stuffed(state_q);
    view_d.stuff_bit    = run_q == 3'd5 && (stuffed(state_q) || state_q == StCrcDel);
    view_d.arbitrates   = arbitrates(state_q, early_q.ext);
    view_d.last         = count_q == last_count(state_q, frame_q.dlc);
    view_d.last_but_one = count_q == 6'd5;  // of the end of frame
    view_d.count        = count_q + 6'd1;
  end

  assign checked = transmitter_q && !(tx_q && view_q.arbitrates);

  // Bits of the longer fields come out of the frame one bit ahead, eight in the first clock after a bit, one of them in
  // the second; a stuff bit leaves the place as it is.
  logic moved_q, ahead_q, place, place_q;
  logic [7:0] eight_q;

  assign place = moved_q ? ahead_q : place_q;

  always_ff @(posedge clk_i) begin
    early_q <= '{tx_frame_i.ext, tx_frame_i.rtr, tx_frame_i.id[17], tx_frame_i.dlc[3], tx_frame_i.data[7]};
    view_q  <= view_d;
    if (bus_off_i && state_q != StBusOff) view_q <= '{count: 6'd1, default: '0};
    tx_q    <= tx;
    moved_q <= sample_i && !view_q.stuff_bit;
    eight_q <= eight(state_q, count_q[5:3] + 3'(count_q[2:0] == '1), tx_frame_i.ext, tx_frame_i.id,
                     tx_frame_i.dlc, tx_frame_i.data);
    ahead_q <= eight_q[~view_q.count[2:0]];
    place_q <= place;
  end

  // Level that is sent in the bit that begins next.
  always_comb begin
    unique case (state_q)
      StSof, StR1, StR0: tx = 1'b0;
      StBase:            tx = (count_q != '0) ? place : tx_frame_i.id[tx_frame_i.ext?28:10];
      StRtr:             tx = early_q.ext || early_q.rtr;
      StIde:             tx = early_q.ext;
      StExtId:           tx = (count_q != '0) ? place : early_q.rest;
      StExtRtr:          tx = early_q.rtr;
      StDlc:             tx = (count_q != '0) ? place : early_q.dlc;
      StData:            tx = (count_q != '0) ? place : early_q.data;
      StCrc:             tx = crc_q[14];
      StAck:             tx = !loopback_i;
      default:           tx = 1'b1;
    endcase
    if (run_q == 3'd5 && (stuffed(state_q) || state_q == StCrcDel)) tx = !last_q;
    if (!transmitter_q) tx = state_q != StAck || crc_bad_q;
    if (state_q == StFlag || state_q == StOverload) tx = 1'b0;
  end

  always_comb begin
    state_d       = state_q;
    count_d       = count_q;
    transmitter_d = transmitter_q;
    frame_d       = frame_q;
    crc_d         = crc_q;
    crc_bad_d     = crc_bad_q;
    run_d         = run_q;
    last_d        = last_q;
    ack_held_d    = ack_held_q;
    first_d       = first_q;
    tx_start_o    = 1'b0;
    tx_sent_o     = 1'b0;
    tx_stop_o     = 1'b0;
    sof_o         = 1'b0;
    rx_valid_o    = 1'b0;
    error_o       = CanNone;
    count_o       = '0;

    if (sample_i) begin
      count_d = view_q.count;

      if (view_q.stuffed || view_q.stuff_bit) begin
        run_d  = (bit_i == last_q) ? run_q + 3'd1 : 3'd1;
        last_d = bit_i;
      end

      if (view_q.stuff_bit) begin
        count_d = count_q;
        if (bit_i == last_q) error_o = checked ? CanBit : CanStuff;
      end else if (view_q.stuffed && checked && bit_i != tx_q) begin
        error_o = CanBit;
      end else begin
        if (view_q.stuffed && transmitter_q && bit_i != tx_q) begin
          transmitter_d = 1'b0;
          tx_stop_o     = 1'b1;
        end
        if (view_q.stuffed) crc_d = crc15(crc_q, bit_i);
        first_d = 1'b0;

        unique case (state_q)
          StIntegrate, StBusOff: begin
            if (!bit_i) count_d = '0;
            else if (view_q.last) begin
              count_o.quiet11 = state_q == StBusOff;
              count_d         = '0;
              if (state_q == StIntegrate) state_d = StIdle;
            end
          end

          StIdle: begin
            transmitter_d = 1'b0;
            sof_o         = !bit_i;
            tx_start_o    = bit_i && tx_request_i;
          end
          StSof: begin
            sof_o = !bit_i;
            if (bit_i) error_o = CanBit;
          end

          StBase: begin
            frame_d.id = {frame_q.id[27:0], bit_i};
            if (view_q.last) {state_d, count_d} = {StRtr, 6'd0};
          end
          StRtr: begin
            frame_d.rtr = bit_i;
            state_d     = StIde;
          end
          StIde: begin
            frame_d.ext = bit_i;
            {state_d, count_d} = {bit_i ? StExtId : StR0, 6'd0};
          end
          StExtId: begin
            frame_d.id = {frame_q.id[27:0], bit_i};
            if (view_q.last) state_d = StExtRtr;
          end
          StExtRtr: begin
            frame_d.rtr = bit_i;
            state_d     = StR1;
          end
          StR1: state_d = StR0;
          StR0: {state_d, count_d} = {StDlc, 6'd0};
          StDlc: begin
            frame_d.dlc = {frame_q.dlc[2:0], bit_i};
            if (view_q.last) {state_d, count_d} = {(frame_q.rtr || frame_d.dlc == '0) ? StCrc : StData, 6'd0};
          end
          StData: begin
            frame_d.data[{count_q[5:3], ~count_q[2:0]}] = bit_i;
            if (view_q.last) {state_d, count_d} = {StCrc, 6'd0};
          end
          StCrc: begin
            crc_d     = {crc_q[13:0], 1'b0};
            crc_bad_d = crc_bad_q || bit_i != crc_q[14];
            if (view_q.last) state_d = StCrcDel;
          end
          StCrcDel: begin
            state_d = StAck;
            if (!bit_i) error_o = transmitter_q ? CanBit : CanForm;
          end
          StAck: begin
            state_d = StAckDel;
            if (bit_i && transmitter_q) error_o = loopback_i ? CanBit : CanAck;
            else if (bit_i && !crc_bad_q) error_o = CanBit;
            else count_o.rx_less1 = !transmitter_q && !crc_bad_q;
          end
          StAckDel: begin
            {state_d, count_d} = {StEof, 6'd0};
            if (!bit_i) error_o = transmitter_q ? CanBit : CanForm;
            else if (crc_bad_q && !transmitter_q) error_o = CanCrc;
          end
          StEof: begin
            if (!bit_i) begin
              if (view_q.last && !transmitter_q) state_d = StOverload;
              else error_o = transmitter_q ? CanBit : CanForm;
            end else if (view_q.last) begin
              {state_d, count_d} = {StInter, 6'd0};
              tx_sent_o          = transmitter_q;
              count_o.tx_less1   = transmitter_q;
            end
            rx_valid_o = bit_i && (transmitter_q ? loopback_i && view_q.last : view_q.last_but_one);
          end

          StInter: begin
            if (!bit_i) begin
              if (view_q.last) sof_o = 1'b1;
              else state_d = StOverload;
              // Its start of frame is also that of a frame that waits.
              tx_start_o = view_q.last && tx_request_i && !(transmitter_q && passive_i);
              if (view_q.last) transmitter_d = 1'b0;
            end else if (view_q.last) begin
              if (transmitter_q && passive_i) {state_d, count_d} = {StSuspend, 6'd0};
              else begin
                state_d       = StIdle;
                transmitter_d = 1'b0;
                tx_start_o    = tx_request_i;
              end
            end
          end
          StSuspend: begin
            sof_o = !bit_i;
            if (!bit_i) transmitter_d = 1'b0;
            else if (view_q.last) begin
              state_d       = StIdle;
              transmitter_d = 1'b0;
              tx_start_o    = tx_request_i;
            end
          end

          StFlag, StOverload: begin
            if (bit_i) error_o = CanBit;
            else if (view_q.last) begin
              {state_d, count_d} = {StWait, 6'd0};
              first_d            = state_q == StFlag;
            end
          end
          StPassive: begin
            // Six equal bits; a missing acknowledgement counts only if somebody else is heard.
            last_d = bit_i;
            if (count_q != '0 && bit_i != last_q) count_d = 6'd1;
            else if (view_q.last) begin
              {state_d, count_d} = {StWait, 6'd0};
              first_d            = 1'b1;
            end
            count_o.tx_add8 = ack_held_q && !bit_i;
            ack_held_d      = ack_held_q && bit_i;
          end
          StWait: begin
            if (bit_i) {state_d, count_d} = {StDelim, 6'd1};
            else begin
              count_o.rx_add8 = first_q && !transmitter_q;
              if (view_q.last) begin
                count_o.tx_add8 = transmitter_q;
                count_o.rx_add8 = !transmitter_q;
                count_d         = '0;
              end
            end
          end
          StDelim: begin
            if (!bit_i) begin
              if (view_q.last) state_d = StOverload;
              else error_o = CanForm;
            end else if (view_q.last) {state_d, count_d} = {StInter, 6'd0};
          end
          default: state_d = StIntegrate;
        endcase

        if (tx_start_o) begin
          state_d       = StSof;
          transmitter_d = 1'b1;
        end
        if (sof_o) begin
          {state_d, count_d} = {StBase, 6'd0};
          crc_d              = '0;
          crc_bad_d          = 1'b0;
          run_d              = 3'd1;
          last_d             = 1'b0;
        end
        if (state_d == StOverload && state_q != StOverload) count_d = '0;
      end

      if (error_o != CanNone) begin
        state_d         = passive_i ? StPassive : StFlag;
        count_d         = '0;
        tx_stop_o       = transmitter_q;
        // Not counted: a stuff error of one's own stuff bit in arbitration. Counted later or not at all: ack_held_q.
        ack_held_d      = error_o == CanAck && passive_i;
        count_o.tx_add8 = transmitter_q && error_o != CanStuff && !ack_held_d;
        count_o.rx_add8 = !transmitter_q && (state_q == StFlag || state_q == StOverload);
        count_o.rx_add1 = !transmitter_q && !count_o.rx_add8;
      end
    end

    if (bus_off_i && state_q != StBusOff) begin
      {state_d, count_d} = {StBusOff, 6'd0};
      transmitter_d      = 1'b0;
      tx_stop_o          = 1'b1;
    end
    if (!bus_off_i && state_q == StBusOff) state_d = StIdle;
  end

  always_ff @(posedge clk_i) begin
    state_q       <= state_d;
    count_q       <= count_d;
    transmitter_q <= transmitter_d;
    frame_q       <= frame_d;
    crc_q         <= crc_d;
    crc_bad_q     <= crc_bad_d;
    run_q         <= run_d;
    last_q        <= last_d;
    ack_held_q    <= ack_held_d;
    first_q       <= first_d;
    // A clock after the start of frame: nobody looks earlier, and the decision need not reach all of it at once.
    sof_q         <= sof_o;
    if (sof_q) frame_q <= '0;
    if (rst_i || !enable_i) begin
      state_q       <= StIntegrate;
      count_q       <= '0;
      transmitter_q <= 1'b0;
      frame_q       <= '0;
      crc_q         <= '0;
      crc_bad_q     <= 1'b0;
      run_q         <= 3'd1;
      last_q        <= 1'b1;
      ack_held_q    <= 1'b0;
      first_q       <= 1'b0;
      sof_q         <= 1'b0;
    end
  end

  assign tx_o       = tx;
  assign rx_frame_o = frame_q;

  always_comb begin
    unique case (state_q)
      StIntegrate, StBusOff, StIdle, StSuspend: hard_o = 1'b1;
      StInter: hard_o = count_q != '0;
      default: hard_o = 1'b0;
    endcase
  end

endmodule
`default_nettype wire
