// Quotients and square roots, four bits in a cycle. Each begins with `load`, in whose cycle its operands are there, and
// ends CYCLES + 1 cycles later; until the next load its result stands.
`default_nettype none

// A digit of a quotient, 0 to 3, from what is left of the dividend, its next two bits, and the divisor.
module quotient_digit #(
    parameter BITS = 24
) (
    input wire [BITS-1:0] rest,  // less than the divisor
    input wire [1:0] bits,
    input wire [BITS-1:0] divisor,
    input wire [BITS+1:0] thrice,
    output wire [BITS-1:0] left,
    output wire [1:0] digit
);
    wire [BITS+2:0] now = {1'b0, rest, bits};
    wire [BITS+2:0] one = now - {3'd0, divisor}, two = now - {2'd0, divisor, 1'b0}, three = now - {1'b0, thrice};
    assign digit = !two[BITS+2] ? {1'b1, !three[BITS+2]} : {1'b0, !one[BITS+2]};
    assign left = digit[1] ? (digit[0] ? three[BITS-1:0] : two[BITS-1:0]) : digit[0] ? one[BITS-1:0] : now[BITS-1:0];
endmodule

// {rest, bits} / divisor, rest being less than the divisor.
module quotient_digits #(
    parameter BITS = 24,
    parameter CYCLES = 7
) (
    input wire clk,
    input wire load,
    input wire [BITS-1:0] rest,
    input wire [4*CYCLES-1:0] bits,
    input wire [BITS-1:0] divisor,
    output wire [4*CYCLES-1:0] quotient,
    output wire inexact
);
    reg [BITS-1:0] left, by;
    reg [BITS+1:0] thrice;
    reg [4*CYCLES-1:0] both;  // what is left of the bits, and the quotient after them
    wire [BITS-1:0] between, after;
    wire [1:0] high, low;
    quotient_digit #(BITS) first (left, both[4*CYCLES-1-:2], by, thrice, between, high);
    quotient_digit #(BITS) second (between, both[4*CYCLES-3-:2], by, thrice, after, low);
    always @(posedge clk) begin
        left <= load ? rest : after;
        both <= load ? bits : {both[4*CYCLES-5:0], high, low};
        if (load) begin
            by <= divisor;
            thrice <= {2'd0, divisor} + {1'b0, divisor, 1'b0};
        end
    end
    assign quotient = both;
    assign inexact = |left;
endmodule

// A digit of a root, 0 to 3, from what is left of the radicand, its next four bits, and the root so far.
module root_digit #(
    parameter BITS = 28  // of the root
) (
    input wire [BITS:0] rest,
    input wire [3:0] bits,
    input wire [BITS-1:0] root,
    output wire [BITS:0] left,
    output wire [1:0] digit
);
    // (4 root + d)^2 exceeds 16 root^2 by d (8 root + d).
    wire [BITS+5:0] now = {1'b0, rest, bits};
    wire [BITS+5:0] one = now - {3'd0, root, 3'b001}, two = now - {2'd0, root, 4'b0100};
    wire [BITS+5:0] three = now - {2'd0, root, 4'b1001} - {3'd0, root, 3'b000};
    assign digit = !two[BITS+5] ? {1'b1, !three[BITS+5]} : {1'b0, !one[BITS+5]};
    assign left = digit[1] ? (digit[0] ? three[BITS:0] : two[BITS:0]) : digit[0] ? one[BITS:0] : now[BITS:0];
endmodule

// The square root of an integer, towards 0.
module root_digits #(
    parameter CYCLES = 7
) (
    input wire clk,
    input wire load,
    input wire [8*CYCLES-1:0] radicand,
    output reg [4*CYCLES-1:0] root,
    output wire inexact
);
    localparam BITS = 4 * CYCLES;
    reg [2*BITS-1:0] bits;  // what is left of the radicand
    reg [BITS:0] left;
    wire [BITS:0] between, after;
    wire [1:0] high, low;
    root_digit #(BITS) first (left, bits[2*BITS-1-:4], root, between, high);
    root_digit #(BITS) second (between, bits[2*BITS-5-:4], {root[BITS-3:0], high}, after, low);
    always @(posedge clk) begin
        left <= load ? {(BITS + 1) {1'b0}} : after;
        root <= load ? {BITS{1'b0}} : {root[BITS-5:0], high, low};
        bits <= load ? radicand : bits << 8;
    end
    assign inexact = |left;
endmodule
`default_nettype wire
