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

endpackage
