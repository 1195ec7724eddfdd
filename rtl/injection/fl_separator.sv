// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Filterless separation of fundamental and HF current: four samples an injection period, square wave ++-- (Yu 2022, eq. 8).
//
// Sample phases k0..k3 = 0..3: at k0 and k2 the HF current crosses zero, at k1 it has its positive, at k3 its negative
// peak. A zero-crossing sample is the fundamental; with it the peak before becomes known:
//   hf = i[peak] - (i[zero before] + i[zero after]) / 2,   amplitude = hf at k1, -hf at k3
// valid_o: a new hf, amplitude, peak_o (0: k1, 1: k3). It needs three samples in a row whose phases follow each other; a
// lost sample costs the values that it belongs to and nothing else. fundamental_o: the latest zero-crossing sample, new
// with fundamental_valid_o.
//
// Formats: currents signed 18 bits, 2^17 = full scale; hf and amplitude signed 20 bits, 2^18 = full scale, exact.
// Latency: valid_i to valid_o and fundamental_valid_o 1 clock, a sample every clock. clear_i forgets the samples.
`default_nettype none
module fl_separator
  import fl_pkg::sample_t;
#(
    localparam int unsigned Latency = 1
) (
    input logic clk_i,
    input logic rst_i,

    input logic          valid_i,
    input sample_t [1:0] current_i,
    input logic    [1:0] phase_i,    // k0..k3
    input logic          clear_i,

    output logic                fundamental_valid_o,
    output sample_t [1:0]       fundamental_o,
    output logic                valid_o,
    output logic                peak_o,
    output logic    [1:0][19:0] hf_o,                // signed
    output logic    [1:0][19:0] amplitude_o          // signed
);

  typedef logic signed [19:0] wide_t;

  // The two samples before, and how many of them follow each other.
  sample_t [1:0] last_q, older_q;
  logic [1:0] phase_q, known_q;
  logic follows;

  assign follows = phase_i == phase_q + 2'd1;

  sample_t [1:0] fundamental_q;
  wide_t [1:0] hf_q;
  logic fundamental_valid_q, valid_q, peak_q;

  always_ff @(posedge clk_i) begin
    fundamental_valid_q <= valid_i && !phase_i[0];
    valid_q             <= valid_i && !phase_i[0] && follows && known_q == 2'd2;
    if (valid_i) begin
      last_q  <= current_i;
      older_q <= last_q;
      phase_q <= phase_i;
      known_q <= (known_q == '0 || !follows) ? 2'd1 : 2'd2;
      if (!phase_i[0]) begin
        fundamental_q <= current_i;
        if (follows && known_q == 2'd2) begin
          peak_q <= phase_q[1];
          for (int unsigned axis = 0; axis < 2; axis++)
          hf_q[axis] <= (20'($signed(last_q[axis])) <<< 1) - 20'($signed(older_q[axis])) -
              20'($signed(current_i[axis]));
        end
      end
    end
    if (clear_i || rst_i) known_q <= '0;
    if (rst_i) begin
      fundamental_valid_q <= 1'b0;
      valid_q             <= 1'b0;
      fundamental_q       <= '0;
      hf_q                <= '0;
      peak_q              <= 1'b0;
    end
  end

  assign fundamental_valid_o = fundamental_valid_q;
  assign fundamental_o       = fundamental_q;
  assign valid_o             = valid_q;
  assign peak_o              = peak_q;
  assign hf_o                = hf_q;
  assign amplitude_o         = peak_q ? {-hf_q[1], -hf_q[0]} : hf_q;

endmodule
`default_nettype wire
