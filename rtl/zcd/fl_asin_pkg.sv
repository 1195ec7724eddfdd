// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Arc sine in intervals of 60 degrees, 2^16 = 1: lines from asin(i / 128) / (pi / 3) to
// the next; the last has no rise.
// Written by `python -m fluxlock.generate.tables`; a test checks it.
package fl_asin_pkg;

  typedef struct packed {
    logic [16:0] start;
    logic [11:0] rise;
  } asin_line_t;

  localparam logic [6:0] AsinLast = 7'd125;
  localparam logic [28:0] AsinLines[126] = '{
    29'h000001e9, 29'h001e91e9, 29'h003d21e9, 29'h005bb1e9, 29'h007a41e9, 29'h0098d1ea, 29'h00b771e9, 29'h00d601ea,
    29'h00f4a1ea, 29'h011341ea, 29'h0131e1eb, 29'h015091eb, 29'h016f41eb, 29'h018df1ec, 29'h01acb1ec, 29'h01cb71ec,
    29'h01ea31ed, 29'h020901ee, 29'h0227e1ee, 29'h0246c1ef, 29'h0265b1ef, 29'h0284a1f0, 29'h02a3a1f1, 29'h02c2b1f1,
    29'h02e1c1f2, 29'h0300e1f3, 29'h032011f4, 29'h033f51f4, 29'h035e91f6, 29'h037df1f6, 29'h039d51f8, 29'h03bcd1f8,
    29'h03dc51fa, 29'h03fbf1fa, 29'h041b91fc, 29'h043b51fd, 29'h045b21fe, 29'h047b01ff, 29'h049af201, 29'h04bb0202,
    29'h04db2204, 29'h04fb6204, 29'h051ba207, 29'h053c1208, 29'h055c9209, 29'h057d220b, 29'h059dd20d, 29'h05bea20e,
    29'h05df8211, 29'h06009212, 29'h0621b214, 29'h0642f216, 29'h06645218, 29'h0685d21a, 29'h06a7721d, 29'h06c9421e,
    29'h06eb2221, 29'h070d3223, 29'h072f6226, 29'h0751c228, 29'h0774422b, 29'h0796f22e, 29'h07b9d230, 29'h07dcd233,
    29'h08000236, 29'h08236239, 29'h0846f23c, 29'h086ab240, 29'h088eb243, 29'h08b2e246, 29'h08d7424a, 29'h08fbe24d,
    29'h0920b251, 29'h0945c256, 29'h096b2259, 29'h0990b25d, 29'h09b68262, 29'h09dca266, 29'h0a03026b, 29'h0a29b270,
    29'h0a50b275, 29'h0a78027a, 29'h0a9fa280, 29'h0ac7a285, 29'h0aeff28b, 29'h0b18a291, 29'h0b41b297, 29'h0b6b229e,
    29'h0b9502a5, 29'h0bbf52ac, 29'h0bea12b3, 29'h0c1542bb, 29'h0c40f2c4, 29'h0c6d32cb, 29'h0c99e2d5, 29'h0cc732df,
    29'h0cf522e8, 29'h0d23a2f3, 29'h0d52d2fd, 29'h0d82a309, 29'h0db33316, 29'h0de49322, 29'h0e16b331, 29'h0e49c33f,
    29'h0e7db34e, 29'h0eb29360, 29'h0ee89371, 29'h0f1fa385, 29'h0f57f39a, 29'h0f9193b0, 29'h0fcc93c9, 29'h100923e3,
    29'h10475402, 29'h10877421, 29'h10c98446, 29'h110de46f, 29'h1154d49c, 29'h119e94d1, 29'h11eba50e, 29'h123c8555,
    29'h1291d5aa, 29'h12ec7614, 29'h134db697, 29'h13b72747, 29'h142b983f, 29'h14af8000
  };

endpackage
