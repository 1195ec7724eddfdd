// Time between a sample and its zero crossing: distance = asin(value / peak) / omega, one sample at a time.
//
// 1 / omega comes from the interval of 60 degrees: asin is taken in intervals, so that
//   distance = interval * asin(x) / (pi/3),   x = value / peak          (Yang 2020: e = psi * omega * sin(omega * t))
//   distance = interval * x / 2               with linear_i: straight flank, peak reached after 30 degrees
// x is a quotient of 16 bits from the divider that the crossing's interpolation uses too (fl_interpolator with
// gap = 2^16 - 1, before = value, after = peak - value); asin is a table of 128 segments with straight lines between.
//
// Formats: value and peak in the same unit, magnitudes; interval and distance in clocks. x at and beyond 125/128
// (linear: beyond 1) saturates: distance is that of the limit (1.29, linear 0.5 intervals), saturated_o comes with it;
// nothing wraps. Error for x <= 0.95: at most interval * 3.2e-4 (0.02 degrees) + 1 clock; up to the limit
// interval * 1.1e-3 + 1 clock.
// Latency: start_i to valid_o Latency clocks, saturated by value >= peak: SaturatedLatency. A start while one runs
// replaces it (the divider is aborted with it).
`default_nettype none
module fl_angle_time #(
    localparam int unsigned Latency          = 25,
    localparam int unsigned SaturatedLatency = 6
) (
    input  logic        clk_i,
    input  logic        rst_i,
    input  logic        start_i,
    input  logic [16:0] value_i,
    input  logic [16:0] peak_i,
    input  logic [23:0] interval_i,    // clocks
    input  logic        linear_i,
    output logic        div_start_o,
    output logic [16:0] div_before_o,
    output logic [16:0] div_after_o,
    input  logic        div_valid_i,
    input  logic [15:0] div_offset_i,
    output logic        busy_o,
    output logic        valid_o,
    output logic [24:0] distance_o,    // clocks
    output logic        saturated_o
);

  import fl_asin_pkg::AsinQ16;
  import fl_asin_pkg::AsinLast;

  typedef enum logic [2:0] {
    Idle,
    Divide,    // x is being found
    Node,      // table: node below x
    NextNode,  // table: node above x
    Line,      // product of the slope
    Sum,       // angle in intervals
    Scale      // times the interval
  } state_e;

  state_e state_q;
  logic [15:0] x_q;  // Q16
  logic [23:0] interval_q;
  logic linear_q, saturated_q, valid_q;
  logic [16:0] node_q, node;  // Q16 intervals
  logic [6:0] address_q;  // in the table
  logic [23:0] factor_q;  // rise of the line, then the interval
  logic [16:0] scale_q;  // place on the line, then the angle in intervals
  logic [40:0] product_q;
  logic beyond;

  assign beyond = value_i >= peak_i;
  assign node   = AsinQ16[address_q];

  always_ff @(posedge clk_i) begin
    valid_q <= 1'b0;
    unique case (state_q)
      Idle:    ;
      Divide: begin
        x_q       <= div_offset_i;
        address_q <= (div_offset_i[15:9] < AsinLast) ? div_offset_i[15:9] : AsinLast;
        if (div_valid_i) begin
          saturated_q <= div_offset_i[15:9] >= AsinLast && !linear_q;
          state_q     <= Node;
        end
      end
      Node: begin
        node_q <= node;
        if (!saturated_q) address_q <= address_q + 7'd1;
        state_q <= NextNode;
      end
      NextNode: begin
        factor_q <= 24'(node - node_q);
        scale_q  <= 17'(x_q[8:0]);
        state_q  <= Line;
      end
      Line:    state_q <= Sum;
      Sum: begin
        if (!linear_q) scale_q <= node_q + 17'((product_q + 41'd256) >> 9);
        else scale_q <= saturated_q ? 17'h08000 : {2'b0, x_q[15:1]};
        factor_q <= interval_q;
        state_q  <= Scale;
      end
      Scale: begin
        valid_q <= 1'b1;
        state_q <= Idle;
      end
      default: state_q <= Idle;
    endcase
    if (state_q == Line || state_q == Scale) product_q <= 41'(factor_q) * 41'(scale_q);
    if (start_i) begin
      interval_q  <= interval_i;
      linear_q    <= linear_i;
      saturated_q <= beyond;
      address_q   <= AsinLast;
      valid_q     <= 1'b0;
      state_q     <= beyond ? Node : Divide;
    end
    if (rst_i) begin
      state_q <= Idle;
      valid_q <= 1'b0;
    end
  end

  assign div_start_o  = start_i && !beyond;
  assign div_before_o = value_i;
  assign div_after_o  = peak_i - value_i;
  assign busy_o       = state_q != Idle;
  assign valid_o      = valid_q;
  assign distance_o   = 25'((product_q + 41'h8000) >> 16);
  assign saturated_o  = saturated_q;

endmodule
`default_nettype wire
