// Quotients and square roots, three bits in a cycle: all eight digits are tried at once. Each begins with `load`, in
// whose cycle its operands are there, and ends CYCLES + 1 cycles later.
`default_nettype none

// The last of eight candidates that is none below 0; candidate 0 is not. The highest bit of each is its sign.
module last_of_eight #(
    parameter BITS = 28
) (
    input wire [8*BITS-1:0] candidates,
    output wire [BITS-1:0] left,
    output wire [2:0] digit
);
    wire [BITS-1:0] c0 = candidates[0+:BITS], c1 = candidates[BITS+:BITS], c2 = candidates[2*BITS+:BITS];
    wire [BITS-1:0] c3 = candidates[3*BITS+:BITS], c4 = candidates[4*BITS+:BITS], c5 = candidates[5*BITS+:BITS];
    wire [BITS-1:0] c6 = candidates[6*BITS+:BITS], c7 = candidates[7*BITS+:BITS];
    wire n1 = c1[BITS-1], n2 = c2[BITS-1], n3 = c3[BITS-1], n4 = c4[BITS-1], n5 = c5[BITS-1], n6 = c6[BITS-1];
    wire n7 = c7[BITS-1];
    // Each pair is decided by the sign of its own, without waiting for another one's.
    wire [BITS-1:0] low = n2 ? (n1 ? c0 : c1) : (n3 ? c2 : c3), high = n6 ? (n5 ? c4 : c5) : (n7 ? c6 : c7);
    assign left = n4 ? low : high;
    assign digit = n4 ? (n2 ? {2'd0, !n1} : {2'd1, !n3}) : (n6 ? {2'd2, !n5} : {2'd3, !n7});
endmodule

// {rest, bits} / divisor, rest being less than the divisor.
module quotient_digits #(
    parameter BITS = 24,
    parameter CYCLES = 9
) (
    input wire clk,
    input wire load,
    input wire [BITS-1:0] rest,
    input wire [3*CYCLES-1:0] bits,
    input wire [BITS-1:0] divisor,
    output reg [3*CYCLES-1:0] quotient,  // behind what is left of the bits
    output wire inexact
);
    localparam WIDE = BITS + 4;
    reg [BITS-1:0] left;
    reg [WIDE-1:0] one, three, five, seven;  // times the divisor
    wire [WIDE-1:0] now = {1'b0, left, quotient[3*CYCLES-1-:3]}, after, by = {4'd0, divisor};
    wire [2:0] digit;
    last_of_eight #(WIDE) choice (
        {now - seven, now - (three << 1), now - five, now - (one << 2), now - three, now - (one << 1), now - one, now},
        after, digit);
    always @(posedge clk) begin
        left <= load ? rest : after[BITS-1:0];
        quotient <= load ? bits : {quotient[3*CYCLES-4:0], digit};
        if (load) begin
            one <= by;
            three <= by + (by << 1);
            five <= by + (by << 2);
            seven <= (by << 3) - by;
        end
    end
    assign inexact = |left;
endmodule

// The square root of an integer, towards 0.
module root_digits #(
    parameter CYCLES = 9
) (
    input wire clk,
    input wire load,
    input wire [6*CYCLES-1:0] radicand,
    output reg [3*CYCLES-1:0] root,
    output wire inexact
);
    localparam BITS = 3 * CYCLES, WIDE = BITS + 8;
    function [WIDE-1:0] square(input [2:0] d);
        square = d * d;
    endfunction
    reg [2*BITS-1:0] bits;  // what is left of the radicand
    reg [BITS:0] left;
    // (8 root + d)^2 exceeds 64 root^2 by d (16 root + d).
    wire [WIDE-1:0] now = {1'b0, left, bits[2*BITS-1-:6]}, after, of = {4'd0, root, 4'd0};
    wire [2:0] digit;
    last_of_eight #(WIDE) choice (
        {now - (of << 3) + of - square(7), now - (of << 2) - (of << 1) - square(6), now - (of << 2) - of - square(5),
            now - (of << 2) - square(4), now - (of << 1) - of - square(3), now - (of << 1) - square(2),
            now - of - square(1), now},
        after, digit);
    always @(posedge clk) begin
        left <= load ? {(BITS + 1) {1'b0}} : after[BITS:0];
        root <= load ? {BITS{1'b0}} : {root[BITS-4:0], digit};
        bits <= load ? radicand : bits << 6;
    end
    assign inexact = |left;
endmodule
`default_nettype wire
