// Pipelined arithmetic on numbers with a fixed point, 20 bits left of it with the sign and 28 right of it, with the
// bits of HardwareFixed in fixed.hpp. Units take operands in every cycle; no unit is reset.
//
//     Inside, a number has 48 bits: a sign, and the size times 2^28. 0 may have either sign.
//
//     The stages of a unit, from its operands to a register with its result: fx_add 2, fx_mul 4, fx_div 13,
//     fx_sqrt 11, fx_choose 1, fx_from_integer 1. fx_div and fx_sqrt (digits.v) take operands when they have ended.
`default_nettype none

// From two's complement.
module fx_in (
    input wire [47:0] x,
    output wire [47:0] z
);
    wire [46:0] size = x[47] ? -x[46:0] : x[46:0];
    assign z = {x[47], x[47] & x[46:0] == 0 ? {47{1'b1}} : size};  // the least one is beyond
endmodule

// To two's complement.
module fx_out (
    input wire [47:0] x,
    output wire [47:0] z
);
    assign z = x[47] ? -{1'b0, x[46:0]} : x;
endmodule

// From a number in two's complement, whose point is where all have it.
module fx_from_integer (
    input wire clk,
    input wire [47:0] x,
    output reg [47:0] z
);
    wire [47:0] number;
    fx_in convert (x, number);
    always @(posedge clk) z <= number;
endmodule

// Sum.
module fx_add (
    input wire clk,
    input wire [47:0] a,
    input wire [47:0] b,
    output reg [47:0] z
);
    // Of sizes: a + b or a - b, and b - a.
    wire minus = a[47] ^ b[47];
    reg [47:0] first1;
    reg [46:0] second1;
    reg a_sign1, minus1;
    always @(posedge clk) begin
        first1 <= minus ? {1'b1, a[46:0]} - {1'b0, b[46:0]} : {1'b0, a[46:0]} + {1'b0, b[46:0]};
        second1 <= b[46:0] - a[46:0];
        {a_sign1, minus1} <= {a[47], minus};
    end
    // The highest bit of the first one: a sum that is too large, or a difference that is none.
    wire other = minus1 & !first1[47], beyond = !minus1 & first1[47];
    always @(posedge clk) z <= {a_sign1 ^ other, other ? second1 : first1[46:0] | {47{beyond}}};
endmodule

// Product: parts that a multiplier of 18 bits has, put together.
module fx_mul (
    input wire clk,
    input wire [47:0] a,
    input wire [47:0] b,
    output reg [47:0] z
);
    wire [17:0] a0 = a[17:0], a1 = a[35:18], b0 = b[17:0], b1 = b[35:18];
    wire [10:0] a2 = a[46:36], b2 = b[46:36];
    reg [35:0] p00, p01, p10, p11;
    reg [28:0] p02, p20, p12, p21;
    reg [21:0] p22;
    reg [93:0] across2;  // those that do not overlap
    reg [65:0] inner2;  // from bit 18 on
    reg [36:0] outer2;  // from bit 36 on
    reg [93:27] sum3;
    reg sign1, sign2, sign3;
    wire [93:0] all = across2 + {10'd0, inner2, 18'd0} + {21'd0, outer2, 36'd0};
    wire [47:0] rounded = {1'b0, sum3[74:28]} + {47'd0, sum3[27]};
    always @(posedge clk) begin
        p00 <= a0 * b0;
        p01 <= a0 * b1;
        p10 <= a1 * b0;
        p11 <= a1 * b1;
        p02 <= a0 * b2;
        p20 <= a2 * b0;
        p12 <= a1 * b2;
        p21 <= a2 * b1;
        p22 <= a2 * b2;
        across2 <= {p22, p11, p00};
        inner2 <= {1'b0, p12, p01} + {1'b0, p21, p10};
        outer2 <= {8'd0, p02} + {8'd0, p20};
        sum3 <= all[93:27];
        z <= {sign3, |sum3[93:75] | rounded[47] ? {47{1'b1}} : rounded[46:0]};
        {sign3, sign2, sign1} <= {sign2, sign1, a[47] ^ b[47]};
    end
endmodule

// Quotient, from `load` on.
module fx_div (
    input wire clk,
    input wire load,
    input wire [47:0] a,
    input wire [47:0] b,
    output wire [47:0] z
);
    reg sign, beyond;
    always @(posedge clk)
        if (load) begin
            sign <= (a[47] & |a[46:0]) ^ (b[47] & |b[46:0]);  // by 0 it counts
            beyond <= {19'd0, a[46:19]} >= b[46:0];
        end
    wire [47:0] quotient;
    wire inexact;
    quotient_digits #(47, 12) digits (clk, load, {20'd0, a[46:20]}, {a[19:0], 28'd0}, b[46:0], quotient, inexact);
    assign z = {sign, quotient[46:0] | {47{beyond}}};
endmodule

// Square root, from `load` on.
module fx_sqrt (
    input wire clk,
    input wire load,
    input wire [47:0] a,
    output wire [47:0] z
);
    wire [39:0] root;
    wire inexact;
    root_digits #(10) digits (clk, load, a[47] ? 80'd0 : {5'd0, a[46:0], 28'd0}, root, inexact);
    assign z = {8'd0, root};
endmodule

// What moves numbers, or was computed by the units above. One stage.
//     0  a < b ? yes : no, and a < b     1  |b| with the sign of a     5, 6, 8  quotient, one root, the other     7  no
module fx_choose (
    input wire clk,
    input wire [3:0] what,
    input wire [47:0] a,
    input wire [47:0] b,
    input wire [47:0] yes,
    input wire [47:0] no,
    input wire [47:0] quotient,
    input wire [47:0] root0,
    input wire [47:0] root1,
    output reg [47:0] z,
    output reg less
);
    wire a_nothing = a[46:0] == 0, b_nothing = b[46:0] == 0;
    wire smaller = a[46:0] < b[46:0], larger = b[46:0] < a[46:0];
    wire below = a[47] ? (b[47] ? larger : !(a_nothing & b_nothing)) : !b[47] & smaller;

    reg [47:0] others;
    always @* case (what)
        4'd1: others = {a[47] & !a_nothing, b[46:0]};
        4'd5: others = quotient;
        4'd6: others = root0;
        4'd8: others = root1;
        default: others = no;
    endcase
    always @(posedge clk) begin
        less <= below;
        z <= below & what == 4'd0 ? yes : others;
    end
endmodule
`default_nettype wire
