// VexRiscv with its RAM, and the bus to the registers.
//
// Memory map (byte addresses): 0 .. 4*Words-1 RAM, 4 KiB of ROM behind it with Boot = 1, 0x8000_0000 and above registers (uncached in the core), anything
// else reads as zero and takes writes without effect. Instructions come straight from RAM or ROM, one a clock; a fetch
// from anywhere else is an access fault. Data pass a cache of 4 KiB, whose bursts are served at one beat a clock.
// irq_current_i is the software interrupt (cause 3), irq_control_i the machine timer interrupt (cause 7), irq_deferred_i
// the external interrupt (cause 11, first bit of the core's interrupt mask CSR 0xBC0). Reset vector 0x80, with Boot = 1 the first word of the ROM, whose
// contents BootInit holds: the loader is there after every reset, whatever the firmware did.
`default_nettype none
module fl_cpu #(
    parameter int unsigned Words = 32768,
    parameter string Init = "firmware.hex",
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
    input  logic [31:0] io_rdat_i
);

  localparam int unsigned AddressWidth = $clog2(Words);
  localparam int unsigned BootWords = 1024;
  localparam int unsigned BootWidth = $clog2(BootWords);
  localparam logic [29:0] BootPage = 30'(Words / BootWords);
  localparam logic [31:0] ResetVector = Boot ? 4 * Words : 32'h0000_0080;
  localparam logic [2:0] CtiIncrementing = 3'd2;

  logic i_en, i_outside_q, i_boot_q;
  logic [29:0] i_adr;
  logic [31:0] i_rdat, i_ram_rdat, i_boot_rdat;

  logic d_cyc, d_stb, d_we, d_ack, d_read_ack_q, d_io, d_memory, d_ram, d_ram_q, d_boot_q;
  logic [29:0] d_adr, d_word;  // of this beat; of the command, the same unless it is a burst
  logic [ 2:0] d_cti;
  logic [31:0] d_wdat, d_rdat, d_ram_rdat, d_boot_rdat;
  logic [3:0] d_sel;
  logic [AddressWidth-1:0] d_ram_adr;

  VexRiscv u_core (
      .clk                   (clk_i),
      .reset                 (rst_i),
      .externalResetVector   (ResetVector),
      .timerInterrupt        (irq_control_i),
      .softwareInterrupt     (irq_current_i),
      .externalInterruptArray({31'b0, irq_deferred_i}),
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
      i_outside_q <= i_adr[29:AddressWidth] != '0 && !(Boot && i_adr >> BootWidth == BootPage);
    end
  end

  assign i_rdat    = i_boot_q ? i_boot_rdat : i_ram_rdat;

  assign d_word[29:3] = d_adr[29:3];

  // Data port: a write is acknowledged at once, a read in the next clock.
  assign d_io      = d_word[29];
  assign d_memory  = d_cyc && d_stb && !d_io;
  assign d_ram     = d_word[28:AddressWidth] == '0;
  assign d_ram_adr = d_adr[AddressWidth-1:0] + AddressWidth'(d_read_ack_q);
  assign d_ack     = d_io ? io_ack_i : (d_we ? d_memory : d_read_ack_q);

  always_ff @(posedge clk_i) begin
    d_read_ack_q <= d_memory && !d_we && (!d_read_ack_q || d_cti == CtiIncrementing);
    d_ram_q      <= d_ram;
    d_boot_q     <= Boot && d_adr[28:0] >> BootWidth == BootPage[28:0];
    if (rst_i) d_read_ack_q <= 1'b0;
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
      .Words(Words),
      .Init (Init)
  ) u_ram (
      .clk_i,
      .a_en_i  (i_en),
      .a_adr_i (i_adr[AddressWidth-1:0]),
      .a_rdat_o(i_ram_rdat),
      .b_we_i  ({4{d_memory && d_ram && d_we}} & d_sel),
      .b_adr_i (d_we ? d_word[AddressWidth-1:0] : d_ram_adr),
      .b_wdat_i(d_wdat),
      .b_rdat_o(d_ram_rdat)
  );

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
