// CAN bit stream processor (ISO 11898-1): one step a sampled bit, sends and receives standard and extended, data and
// remote frames; arbitration, stuffing, CRC, acknowledgement, error and overload frames, bus integration.
//
// State and outputs say which field the next sampled bit belongs to; tx_o is the level sent in that bit.
// Transmission: with tx_request_i in the bit before a start of frame, tx_start_o pulses and tx_frame_i must stay as it is
// from that clock to tx_sent_o or tx_stop_o (arbitration lost, error, bus-off). A dominant third bit of the intermission
// is taken as the start of frame of this node's own frame too.
// Reception: rx_valid_o with rx_frame_o after the last but one bit of the end of frame. Reserved bits and the substitute
// remote bit are received at either level. With loopback_i the transmitter acknowledges and receives its own frames.
// Errors: error_o with the bit that shows it, count_o with the bit that moves a counter; passive_i and bus_off_i are the
// state before that bit. No overload frame is sent for want of time, only in answer.
//
// All outputs but tx_o, hard_o and rx_frame_o are pulses within sample_i. Latency: sample_i to tx_o 1 clock.
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
  logic tx_d, tx_q;
  logic transmitter_d, transmitter_q;  // of the last frame
  can_frame_t frame_d, frame_q;
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

  // Level that a transmitter sends in a bit of a field.
  function automatic logic own(state_e state, logic [5:0] place, can_frame_t frame, logic crc_bit);
    logic [4:0] at;
    at = place[4:0];
    unique case (state)
      StSof, StR1, StR0: return 1'b0;
      StBase:            return frame.id[(frame.ext ? 5'd28 : 5'd10)-at];
      StRtr:             return frame.ext || frame.rtr;
      StIde:             return frame.ext;
      StExtId:           return frame.id[5'd17-at];
      StExtRtr:          return frame.rtr;
      StDlc:             return frame.dlc[2'd3-at[1:0]];
      StData:            return frame.data[{place[5:3], ~place[2:0]}];
      StCrc:             return crc_bit;
      default:           return 1'b1;
    endcase
  endfunction

  logic stuff_bit;
  logic [5:0] last_data;
  assign stuff_bit = run_q == 3'd5 && (stuffed(state_q) || state_q == StCrcDel);
  assign last_data = {frame_q.dlc[2:0] - 3'd1, 3'd7};  // eight bytes: 0 - 1 = 7

  always_comb begin
    state_d       = state_q;
    count_d       = count_q;
    tx_d          = tx_q;
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
      count_d = count_q + 6'd1;

      if (stuffed(state_q) || stuff_bit) begin
        run_d  = (bit_i == last_q) ? run_q + 3'd1 : 3'd1;
        last_d = bit_i;
      end

      if (stuff_bit) begin
        count_d = count_q;
        if (bit_i == last_q) begin
          error_o = (transmitter_q && !(tx_q && arbitrates(state_q, tx_frame_i.ext))) ? CanBit : CanStuff;
        end
      end else if (transmitter_q && stuffed(state_q) && bit_i != tx_q &&
                   !(tx_q && arbitrates(state_q, tx_frame_i.ext))) begin
        error_o = CanBit;
      end else begin
        if (transmitter_q && stuffed(state_q) && bit_i != tx_q) begin
          transmitter_d = 1'b0;
          tx_stop_o     = 1'b1;
        end
        if (stuffed(state_q)) crc_d = crc15(crc_q, bit_i);
        first_d = 1'b0;

        unique case (state_q)
          StIntegrate, StBusOff: begin
            if (!bit_i) count_d = '0;
            else if (count_q == 6'd10) begin
              count_o.quiet11 = 1'b1;
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
            if (count_q == 6'd10) {state_d, count_d} = {StRtr, 6'd0};
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
            if (count_q == 6'd17) state_d = StExtRtr;
          end
          StExtRtr: begin
            frame_d.rtr = bit_i;
            state_d     = StR1;
          end
          StR1: state_d = StR0;
          StR0: {state_d, count_d} = {StDlc, 6'd0};
          StDlc: begin
            frame_d.dlc = {frame_q.dlc[2:0], bit_i};
            if (count_q == 6'd3) {state_d, count_d} = {(frame_q.rtr || frame_d.dlc == '0) ? StCrc : StData, 6'd0};
          end
          StData: begin
            frame_d.data[{count_q[5:3], ~count_q[2:0]}] = bit_i;
            if (count_q == (frame_q.dlc[3] ? 6'd63 : last_data)) {state_d, count_d} = {StCrc, 6'd0};
          end
          StCrc: begin
            crc_d     = {crc_q[13:0], 1'b0};
            crc_bad_d = crc_bad_q || bit_i != crc_q[14];
            if (count_q == 6'd14) state_d = StCrcDel;
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
              if (count_q == 6'd6 && !transmitter_q) state_d = StOverload;
              else error_o = transmitter_q ? CanBit : CanForm;
            end else if (count_q == 6'd6) begin
              {state_d, count_d} = {StInter, 6'd0};
              tx_sent_o          = transmitter_q;
              count_o.tx_less1   = transmitter_q;
            end
            rx_valid_o = bit_i && (transmitter_q ? loopback_i && count_q == 6'd6 : count_q == 6'd5);
          end

          StInter: begin
            if (!bit_i) begin
              if (count_q == 6'd2) sof_o = 1'b1;
              else state_d = StOverload;
              // Its start of frame is also that of a frame that waits.
              tx_start_o = count_q == 6'd2 && tx_request_i && !(transmitter_q && passive_i);
              if (count_q == 6'd2) transmitter_d = 1'b0;
            end else if (count_q == 6'd2) begin
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
            else if (count_q == 6'd7) begin
              state_d       = StIdle;
              transmitter_d = 1'b0;
              tx_start_o    = tx_request_i;
            end
          end

          StFlag, StOverload: begin
            if (bit_i) error_o = CanBit;
            else if (count_q == 6'd5) begin
              {state_d, count_d} = {StWait, 6'd0};
              first_d            = state_q == StFlag;
            end
          end
          StPassive: begin
            // Six equal bits; a missing acknowledgement counts only if somebody else is heard.
            last_d = bit_i;
            if (count_q != '0 && bit_i != last_q) count_d = 6'd1;
            count_o.tx_add8 = ack_held_q && !bit_i;
            ack_held_d      = ack_held_q && bit_i;
            if (count_d == 6'd6) begin
              {state_d, count_d} = {StWait, 6'd0};
              first_d            = 1'b1;
            end
          end
          StWait: begin
            if (bit_i) {state_d, count_d} = {StDelim, 6'd1};
            else begin
              count_o.rx_add8 = first_q && !transmitter_q;
              if (count_q == 6'd7) begin
                count_o.tx_add8 = transmitter_q;
                count_o.rx_add8 = !transmitter_q;
                count_d         = '0;
              end
            end
          end
          StDelim: begin
            if (!bit_i) begin
              if (count_q == 6'd7) state_d = StOverload;
              else error_o = CanForm;
            end else if (count_q == 6'd7) {state_d, count_d} = {StInter, 6'd0};
          end
          default: state_d = StIntegrate;
        endcase

        if (tx_start_o) begin
          state_d       = StSof;
          transmitter_d = 1'b1;
        end
        if (sof_o) begin
          {state_d, count_d} = {StBase, 6'd0};
          frame_d            = '0;
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

      tx_d = !transmitter_d || own(state_d, count_d, tx_frame_i, crc_d[14]);
      if (transmitter_d && run_d == 3'd5 && (stuffed(state_d) || state_d == StCrcDel)) tx_d = !last_d;
      if (state_d == StAck) tx_d = transmitter_d ? !loopback_i : crc_bad_d;
      if (state_d == StFlag || state_d == StOverload) tx_d = 1'b0;
    end

    if (bus_off_i && state_q != StBusOff) begin
      {state_d, count_d} = {StBusOff, 6'd0};
      tx_d               = 1'b1;
      transmitter_d      = 1'b0;
      tx_stop_o          = 1'b1;
    end
    if (!bus_off_i && state_q == StBusOff) state_d = StIdle;
  end

  always_ff @(posedge clk_i) begin
    state_q       <= state_d;
    count_q       <= count_d;
    tx_q          <= tx_d;
    transmitter_q <= transmitter_d;
    frame_q       <= frame_d;
    crc_q         <= crc_d;
    crc_bad_q     <= crc_bad_d;
    run_q         <= run_d;
    last_q        <= last_d;
    ack_held_q    <= ack_held_d;
    first_q       <= first_d;
    if (rst_i || !enable_i) begin
      state_q       <= StIntegrate;
      count_q       <= '0;
      tx_q          <= 1'b1;
      transmitter_q <= 1'b0;
      frame_q       <= '0;
      crc_q         <= '0;
      crc_bad_q     <= 1'b0;
      run_q         <= 3'd1;
      last_q        <= 1'b1;
      ack_held_q    <= 1'b0;
      first_q       <= 1'b0;
    end
  end

  assign tx_o       = tx_q;
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
