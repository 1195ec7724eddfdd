// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// VexRiscv with its RAM, and the bus to the registers.
//
// Memory map (byte addresses): RAM in a window of the power of two that is not less than Words; 4 KiB of ROM behind the
// window with Boot = 1; 0x8000_0000 and above registers (uncached in the core); anything else reads as zero and takes
// writes without effect. A RAM that does not fill its window is one bank a power of two, since block RAMs of one depth
// would need a wide choice among their outputs: the largest from 0 on, the others behind it, but the smallest at the
// window's end, where stack, parameter block and telemetry are whatever the size. 22 528 words: 16 384 and 4096 from 0,
// 2048 at 0x1_E000.
// Instructions come straight from RAM or ROM, one a clock; a fetch from anywhere else is an access fault. Data pass a cache
// of 4 KiB, whose bursts are served at one beat a clock.
// irq_current_i is the software interrupt (cause 3), irq_control_i the machine timer interrupt (cause 7),
// irq_deferred_i the external interrupt (cause 11, first bit of the core's interrupt mask CSR 0xBC0). Reset vector 0x80,
// with Boot = 1 the first word of the ROM, whose contents BootInit holds: the loader is there after every reset, whatever
// the firmware did.
// The debug bus halts and resets the core alone: the chip goes on.
`default_nettype none
module fl_cpu #(
    parameter int unsigned Words = 32768,
    parameter string Init = "firmware.hex",  // of the largest bank
    parameter bit Boot = 0,
    parameter string BootInit = "boot.hex"
) (
    input logic clk_i,
    input logic rst_i,

    input logic irq_current_i,
    input logic irq_control_i,
    input logic irq_deferred_i,

    output logic        io_stb_o,   // held until io_ack_i
    output logic        io_we_o,
    output logic [29:0] io_adr_o,   // word address below the I/O base
    output logic [31:0] io_wdat_o,
    output logic [ 3:0] io_sel_o,
    input  logic        io_ack_i,
    input  logic [31:0] io_rdat_i,

    // Debug bus: answers where generated/VexRiscv_Debug.v is the core. The plain core takes no command.
    input  logic        debug_valid_i,  // held until debug_ready_o
    output logic        debug_ready_o,
    input  logic        debug_we_i,
    input  logic [ 7:0] debug_adr_i,    // byte address
    input  logic [31:0] debug_wdat_i,
    output logic [31:0] debug_rdat_o    // for the address of the clock before
);

  localparam int unsigned AddressWidth = $clog2(Words);
  localparam int unsigned Window = 1 << AddressWidth;
  localparam int unsigned Largest = $clog2(Words + 1) - 1;  // bank, as below
  localparam int unsigned BootWords = 1024;
  localparam int unsigned BootWidth = $clog2(BootWords);
  localparam logic [29:0] BootPage = 30'(Window / BootWords);
  localparam logic [31:0] ResetVector = Boot ? 4 * Window : 32'h0000_0080;
  localparam logic [2:0] CtiIncrementing = 3'd2;

  // Bank n has 2^n words; those that there are, are the bits of Words.
  typedef logic [Largest:0] banks_t;

  // Bank that a word address belongs to, none for an address without RAM.
  function automatic banks_t bank_of(logic [29:0] word);
    int unsigned first;
    bank_of = '0;
    first   = 0;
    for (int n = Largest; n >= 0; n--) begin
      if (Words[n]) begin
        if (Words % (1 << n) == 0) first = Window - (1 << n);  // the smallest
        bank_of[n] = word >> n == 30'(first >> n);
        first += 1 << n;
      end
    end
  endfunction

  banks_t i_bank, i_bank_q, d_bank, d_bank_q;
  logic [Largest:0][31:0] i_bank_rdat, d_bank_rdat;
  logic i_en, i_outside_q, i_boot_q;
  logic [29:0] i_adr;
  logic [31:0] i_rdat, i_ram_rdat, i_boot_rdat;

  logic d_cyc, d_stb, d_we, d_ack, d_read_ack_q, d_io, d_memory, d_ram, d_ram_q, d_boot_q;
  logic [29:0] d_adr, d_word;  // of this beat; of the command, the same unless it is a burst
  logic [ 2:0] d_cti;
  logic [31:0] d_wdat, d_rdat, d_ram_rdat, d_boot_rdat;
  logic [3:0] d_sel;
  logic [AddressWidth-1:0] d_ram_adr;

  // The debugger's reset is the core's alone: chip and debug logic keep their state.
  logic debug_rst, core_rst;
  assign core_rst = rst_i || debug_rst;

  VexRiscv u_core (
      .clk                   (clk_i),
      .reset                 (core_rst),
      .externalResetVector   (ResetVector),
      .timerInterrupt        (irq_control_i),
      .softwareInterrupt     (irq_current_i),
      .externalInterruptArray({31'b0, irq_deferred_i}),
      .debug_bus_cmd_valid   (debug_valid_i),
      .debug_bus_cmd_ready   (debug_ready_o),
      .debug_bus_cmd_payload_wr(debug_we_i),
      .debug_bus_cmd_payload_address(debug_adr_i),
      .debug_bus_cmd_payload_data(debug_wdat_i),
      .debug_bus_rsp_data    (debug_rdat_o),
      .debug_resetOut        (debug_rst),
      .debugReset            (rst_i),
      .instructionMemory_EN  (i_en),
      .instructionMemory_ADR (i_adr),
      .instructionMemory_DAT (i_rdat),
      .instructionMemory_ERR (i_outside_q),
      .iBusWishbone_CYC      (),
      .iBusWishbone_STB      (),
      .iBusWishbone_ACK      (1'b0),
      .iBusWishbone_WE       (),
      .iBusWishbone_ADR      (),
      .iBusWishbone_DAT_MISO ('0),
      .iBusWishbone_DAT_MOSI (),
      .iBusWishbone_SEL      (),
      .iBusWishbone_ERR      (1'b0),
      .iBusWishbone_CTI      (),
      .iBusWishbone_BTE      (),
      .dBusWishbone_CYC      (d_cyc),
      .dBusWishbone_STB      (d_stb),
      .dBusWishbone_ACK      (d_ack),
      .dBusWishbone_WE       (d_we),
      .dBusWishbone_WORD     (d_word[2:0]),
      .dBusWishbone_ADR      (d_adr),
      .dBusWishbone_DAT_MISO (d_rdat),
      .dBusWishbone_DAT_MOSI (d_wdat),
      .dBusWishbone_SEL      (d_sel),
      .dBusWishbone_ERR      (1'b0),
      .dBusWishbone_CTI      (d_cti),
      .dBusWishbone_BTE      ()
  );

  always_ff @(posedge clk_i) begin
    if (i_en) begin
      i_boot_q    <= Boot && i_adr >> BootWidth == BootPage;
      i_bank_q    <= i_bank;
      i_outside_q <= i_bank == '0 && !(Boot && i_adr >> BootWidth == BootPage);
    end
  end

  assign i_bank    = bank_of(i_adr);
  assign i_rdat    = i_boot_q ? i_boot_rdat : i_ram_rdat;

  assign d_word[29:3] = d_adr[29:3];

  // Data port: a write is acknowledged at once, a read in the next clock.
  assign d_io      = d_word[29];
  assign d_memory  = d_cyc && d_stb && !d_io;
  assign d_bank    = bank_of({1'b0, d_word[28:0]});
  assign d_ram     = d_bank != '0;
  assign d_ram_adr = d_adr[AddressWidth-1:0] + AddressWidth'(d_read_ack_q);
  assign d_ack     = d_io ? io_ack_i : (d_we ? d_memory : d_read_ack_q);

  always_ff @(posedge clk_i) begin
    d_read_ack_q <= d_memory && !d_we && (!d_read_ack_q || d_cti == CtiIncrementing);
    d_ram_q      <= d_ram;
    d_bank_q     <= d_bank;
    d_boot_q     <= Boot && d_adr[28:0] >> BootWidth == BootPage[28:0];
    if (core_rst) d_read_ack_q <= 1'b0;
  end

  always_comb begin
    if (d_io) d_rdat = io_rdat_i;
    else if (d_ram_q) d_rdat = d_ram_rdat;
    else if (d_boot_q) d_rdat = d_boot_rdat;
    else d_rdat = '0;
  end

  assign io_stb_o  = d_cyc && d_stb && d_io;
  assign io_we_o   = d_we;
  assign io_adr_o  = {1'b0, d_word[28:0]};
  assign io_wdat_o = d_wdat;
  assign io_sel_o  = d_sel;

  fl_ram #(
      .Words(1 << Largest),
      .Init (Init)
  ) u_ram (
      .clk_i,
      .a_en_i  (i_en),
      .a_adr_i (i_adr[Largest-1:0]),
      .a_rdat_o(i_bank_rdat[Largest]),
      .b_we_i  ({4{d_memory && d_bank[Largest] && d_we}} & d_sel),
      .b_adr_i (d_we ? d_word[Largest-1:0] : d_ram_adr[Largest-1:0]),
      .b_wdat_i(d_wdat),
      .b_rdat_o(d_bank_rdat[Largest])
  );

  for (genvar n = 0; n < Largest; n++) begin : g_bank
    if (Words[n]) begin : g_ram
      fl_ram #(
          .Words(1 << n),
          .Init ("")
      ) u_ram (
          .clk_i,
          .a_en_i  (i_en),
          .a_adr_i (i_adr[n-1:0]),
          .a_rdat_o(i_bank_rdat[n]),
          .b_we_i  ({4{d_memory && d_bank[n] && d_we}} & d_sel),
          .b_adr_i (d_we ? d_word[n-1:0] : d_ram_adr[n-1:0]),
          .b_wdat_i(d_wdat),
          .b_rdat_o(d_bank_rdat[n])
      );
    end else begin : g_none
      assign {i_bank_rdat[n], d_bank_rdat[n]} = '0;
    end
  end

  always_comb begin
    i_ram_rdat = i_bank_rdat[Largest];
    d_ram_rdat = d_bank_rdat[Largest];
    for (int n = 0; n < Largest; n++) begin
      if (i_bank_q[n]) i_ram_rdat = i_bank_rdat[n];
      if (d_bank_q[n]) d_ram_rdat = d_bank_rdat[n];
    end
  end

  if (Boot) begin : g_boot
    fl_ram #(
        .Words(BootWords),
        .Init (BootInit)
    ) u_rom (
        .clk_i,
        .a_en_i  (i_en),
        .a_adr_i (i_adr[BootWidth-1:0]),
        .a_rdat_o(i_boot_rdat),
        .b_we_i  ('0),
        .b_adr_i (d_ram_adr[BootWidth-1:0]),
        .b_wdat_i('0),
        .b_rdat_o(d_boot_rdat)
    );
  end else begin : g_no_boot
    assign i_boot_rdat = '0;
    assign d_boot_rdat = '0;
  end

endmodule
`default_nettype wire
