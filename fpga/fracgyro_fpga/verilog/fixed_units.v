// Pipelined arithmetic on numbers with a fixed point, 20 bits left of it with the sign and 28 right of it, with the
// bits of HardwareFixed in fixed.hpp. Units take operands in every cycle; no unit is reset.
//
//     Inside, a number has 48 bits: a sign, and the size times 2^28. 0 may have either sign.
//
//     The stages of a unit, from its operands to a register with its result: fx_add 1, fx_mul 3, fx_div 17,
//     fx_sqrt 20, fx_choose 1, fx_from_integer 1. fx_div and fx_sqrt (digits.v) take operands when they have ended.
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
    // Of sizes: a + b or a - b, and b - a. The highest bit of the first one: a sum that is too large, or a difference
    // that is none.
    wire minus = a[47] ^ b[47];
    wire [47:0] first = minus ? {1'b1, a[46:0]} - {1'b0, b[46:0]} : {1'b0, a[46:0]} + {1'b0, b[46:0]};
    wire [46:0] second = b[46:0] - a[46:0];
    wire beyond = !minus & first[47], smaller, larger, other = minus & smaller;
    compare #(47) sizes (a[46:0], b[46:0], smaller, larger);
    always @(posedge clk) z <= {a[47] ^ other, other ? second : first[46:0] | {47{beyond}}};
endmodule

// Product: parts that a multiplier of 18 bits has, put together, and rounded.
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
    reg [65:0] high;
    reg [1:0] carry;
    reg sign1, sign2;
    // Parts in one row do not overlap. What is below place 28, the last one that is kept, is added apart from the rest:
    // places 18 to 27 of three rows, and the half that rounds.
    wire [93:0] r0 = {p22, p11, p00}, r1 = {11'd0, p12, p01, 18'd0}, r2 = {11'd0, p21, p10, 18'd0};
    wire [65:0] r3 = {29'd0, p02, 8'd0}, r4 = {29'd0, p20, 8'd0};
    wire [11:0] low = {2'd0, r0[27:18]} + {2'd0, r1[27:18]} + {2'd0, r2[27:18]} + 12'd512;
    wire [47:0] rounded = {1'b0, high[46:0]} + {46'd0, carry};
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
        high <= r0[93:28] + r1[93:28] + r2[93:28] + r3 + r4;
        carry <= low[11:10];
        z <= {sign2, |high[65:47] | rounded[47] ? {47{1'b1}} : rounded[46:0]};
        {sign2, sign1} <= {sign1, a[47] ^ b[47]};
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
    quotient_digits #(47, 16) digits (clk, load, {20'd0, a[46:20]}, {a[19:0], 28'd0}, b[46:0], quotient, inexact);
    assign z = {sign, quotient[46:0] | {47{beyond}}};
endmodule

// Square root, from `load` on.
module fx_sqrt (
    input wire clk,
    input wire load,
    input wire [47:0] a,
    output wire [47:0] z
);
    wire [37:0] root;
    wire inexact;
    root_digits #(19) digits (clk, load, a[47] ? 76'd0 : {1'b0, a[46:0], 28'd0}, root, inexact);
    assign z = {10'd0, root};
endmodule

// What moves numbers, or was computed by the units above. One stage.
//     0  a < b ? yes : no, and a < b     1  |b| with the sign of a     5 to 8  quotients, roots
module fx_choose (
    input wire clk,
    input wire [3:0] what,
    input wire [47:0] a,
    input wire [47:0] b,
    input wire [47:0] yes,
    input wire [47:0] no,
    input wire [47:0] quotient0,
    input wire [47:0] quotient1,
    input wire [47:0] root0,
    input wire [47:0] root1,
    output reg [47:0] z,
    output reg less
);
    wire a_nothing = a[46:0] == 0, b_nothing = b[46:0] == 0;
    wire smaller, larger;
    compare #(47) sizes (a[46:0], b[46:0], smaller, larger);
    wire below = a[47] ? (b[47] ? larger : !(a_nothing & b_nothing)) : !b[47] & smaller;

    // One of sixteen, chosen by the bits of `what` as they are.
    wire [47:0] signed_as = {a[47] & !a_nothing, b[46:0]};
    wire [16*48-1:0] each = {{7{no}}, root1, root0, quotient1, quotient0, {3{no}}, signed_as, no};
    wire [47:0] others = each[what*48+:48];
    always @(posedge clk) begin
        less <= below;
        z <= below & what == 4'd0 ? yes : others;
    end
endmodule
`default_nettype wire
