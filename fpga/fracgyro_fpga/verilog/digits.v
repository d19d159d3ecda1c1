// Quotients, three bits in a cycle, and square roots, two: all digits are tried at once. Each begins with `load`, in
// whose cycle its operands are there, and ends CYCLES + 1 cycles later. And a comparison.
`default_nettype none

// a < b and b < a. Their halves are compared side by side: half as long a chain of carries.
module compare #(
    parameter BITS = 32
) (
    input wire [BITS-1:0] a,
    input wire [BITS-1:0] b,
    output wire less,
    output wire greater
);
    localparam LOW = BITS / 2;
    wire low_less = a[LOW-1:0] < b[LOW-1:0], low_greater = b[LOW-1:0] < a[LOW-1:0];
    wire high_less = a[BITS-1:LOW] < b[BITS-1:LOW], high_greater = b[BITS-1:LOW] < a[BITS-1:LOW];
    assign less = high_less | !high_greater & low_less;
    assign greater = high_greater | !high_less & low_greater;
endmodule

// The last of four candidates that is none below 0; candidate 0 is taken for none. The highest bit of each is its sign.
module last_of_four #(
    parameter BITS = 28
) (
    input wire [4*BITS-1:0] candidates,
    output wire [BITS-1:0] left,
    output wire [1:0] digit
);
    wire [BITS-1:0] c0 = candidates[0+:BITS], c1 = candidates[BITS+:BITS], c2 = candidates[2*BITS+:BITS];
    wire [BITS-1:0] c3 = candidates[3*BITS+:BITS];
    // Each pair is decided by the sign of its own, without waiting for another one's.
    assign left = c2[BITS-1] ? (c1[BITS-1] ? c0 : c1) : (c3[BITS-1] ? c2 : c3);
    assign digit = c2[BITS-1] ? {1'b0, !c1[BITS-1]} : {1'b1, !c3[BITS-1]};
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
    wire [WIDE-1:0] four = now - (one << 2), low, high;
    wire [1:0] low_digit, high_digit;
    last_of_four #(WIDE) lower ({now - three, now - (one << 1), now - one, now}, low, low_digit);
    last_of_four #(WIDE) upper ({now - seven, now - (three << 1), now - five, four}, high, high_digit);
    assign after = four[WIDE-1] ? low : high;
    wire [2:0] digit = four[WIDE-1] ? {1'b0, low_digit} : {1'b1, high_digit};
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
    parameter CYCLES = 13
) (
    input wire clk,
    input wire load,
    input wire [4*CYCLES-1:0] radicand,
    output reg [2*CYCLES-1:0] root,
    output wire inexact
);
    localparam BITS = 2 * CYCLES, WIDE = BITS + 6;
    reg [2*BITS-1:0] bits;  // what is left of the radicand
    reg [BITS:0] left;
    // (4 root + d)^2 exceeds 16 root^2 by d (8 root + d).
    wire [WIDE-1:0] now = {1'b0, left, bits[2*BITS-1-:4]}, after;
    wire [1:0] digit;
    last_of_four #(WIDE) choice (
        {now - {2'd0, root, 4'b1001} - {3'd0, root, 3'd0}, now - {2'd0, root, 4'b0100}, now - {3'd0, root, 3'b001},
            now}, after, digit);
    always @(posedge clk) begin
        left <= load ? {(BITS + 1) {1'b0}} : after[BITS:0];
        root <= load ? {BITS{1'b0}} : {root[BITS-3:0], digit};
        bits <= load ? radicand : bits << 4;
    end
    assign inexact = |left;
endmodule
`default_nettype wire
