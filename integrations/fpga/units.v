// Pipelined arithmetic on IEEE 754 single precision, with the bits of a processor: subnormal numbers included, to the
// nearest, ties to even. Each unit takes operands in every cycle; no unit is reset.
//
//     Inside, a number has 33 bits: sign, 9 bits of exponent, 23 bits of fraction. The exponent is that of the value
//     plus 256, also of what is subnormal outside: every number but 0 has its leading one. Exponent 0: zero. Exponent
//     511: infinity where the fraction is 0, else NaN, of which there is one.
//
//     The stages of a unit, from its operands to a register with its result: fp_add 6, fp_mul 5, fp_div 16,
//     fp_sqrt 15, fp_exponent 3, fp_choose 1, fp_from_integer 4.
`default_nettype none
`define ORIGIN 23'h3504F3 // the fraction of sqrt(1/2)

// From float32.
module fp_in (
    input wire [31:0] x,
    output wire [32:0] z
);
    wire [7:0] exponent = x[30:23];
    wire [22:0] fraction = x[22:0];
    reg [4:0] zeros;  // ahead of the leading one of a subnormal number
    integer i;
    always @* begin
        zeros = 0;
        for (i = 0; i < 23; i = i + 1) if (fraction[i]) zeros = 5'd22 - i[4:0];
    end
    wire [22:0] shifted = fraction << (zeros + 5'd1);
    wire subnormal = exponent == 0;
    wire special = exponent == 8'd255;
    assign z = special ? {x[31] & fraction == 0, 9'd511, |fraction, 22'd0}
             : subnormal ? (fraction == 0 ? {x[31], 32'd0} : {x[31], 9'd129 - {4'd0, zeros}, shifted})
             : {x[31], {1'b0, exponent} + 9'd129, fraction};
endmodule

// To float32. Combinational.
module fp_out (
    input wire [32:0] x,
    output wire [31:0] z
);
    wire [8:0] exponent = x[31:23];
    wire [8:0] normal = exponent - 9'd129;
    wire [8:0] below = 9'd130 - exponent;
    wire [23:0] shifted = {1'b1, x[22:0]} >> below;
    assign z = exponent == 9'd511 ? {x[32], 8'd255, x[22], 22'd0}
             : exponent == 0 ? {x[32], 31'd0}
             : exponent < 9'd130 ? {x[32], 8'd0, shifted[22:0]}
             : {x[32], normal[7:0], x[22:0]};
endmodule

// From a signed integer.
module fp_from_integer (
    input wire clk,
    input wire [31:0] x,
    output reg [32:0] z
);
    reg [31:0] magnitude1, magnitude2, shifted3;
    reg [4:0] zeros, zeros2;
    reg [8:0] exponent3;
    reg sign1, sign2, sign3, nothing3;
    integer i;
    always @* begin
        zeros = 0;
        for (i = 0; i < 32; i = i + 1) if (magnitude1[i]) zeros = 5'd31 - i[4:0];
    end
    always @(posedge clk) begin
        magnitude1 <= x[31] ? -x : x;
        magnitude2 <= magnitude1;
        zeros2 <= zeros;
        shifted3 <= magnitude2 << zeros2;
        exponent3 <= 9'd287 - {4'd0, zeros2};
        nothing3 <= magnitude2 == 0;
        {sign3, sign2, sign1} <= {sign2, sign1, x[31]};
    end
    wire up = shifted3[7] & (shifted3[8] | |shifted3[6:0]);
    wire [24:0] rounded = {1'b0, shifted3[31:8]} + {24'd0, up};
    wire [8:0] exponent = exponent3 + {8'd0, rounded[24]};
    always @(posedge clk) z <= nothing3 ? 33'd0 : {sign3, exponent, rounded[24] ? 23'd0 : rounded[22:0]};
endmodule

// Sum. Results that are subnormal outside are exact: there is nothing to round below 2^-149.
module fp_add (
    input wire clk,
    input wire [32:0] a,
    input wire [32:0] b,
    output reg [32:0] z
);
    // The larger and the smaller magnitude.
    wire swap = a[31:0] < b[31:0];
    wire [8:0] a_over_b = a[31:23] - b[31:23], b_over_a = b[31:23] - a[31:23];
    wire [32:0] big = swap ? b : a, little = swap ? a : b;
    wire a_nan = a[31:23] == 9'd511 & a[22], b_nan = b[31:23] == 9'd511 & b[22];
    wire both_infinite = a[31:23] == 9'd511 & b[31:23] == 9'd511;
    reg [23:0] big1, little1;
    reg [8:0] exponent1, distance1;
    reg sign1, minus1, nan1, infinite1, zero1;
    always @(posedge clk) begin
        big1 <= {big[31:23] != 0, big[22:0]};
        little1 <= {little[31:23] != 0, little[22:0]};
        exponent1 <= big[31:23];
        distance1 <= swap ? b_over_a : a_over_b;
        sign1 <= big[32];
        minus1 <= a[32] ^ b[32];
        nan1 <= a_nan | b_nan | (both_infinite & (a[32] ^ b[32]));
        infinite1 <= big[31:23] == 9'd511;
        zero1 <= a[32] & b[32];  // the sign of a sum of zeros
    end
    // The smaller one shifted, what falls out kept as one bit.
    wire [53:0] wide = {little1, 30'd0} >> (distance1 > 9'd27 ? 9'd27 : distance1);
    reg [23:0] big2;
    reg [26:0] little2;
    reg [8:0] exponent2;
    reg sign2, minus2, nan2, infinite2, zero2;
    always @(posedge clk) begin
        big2 <= big1;
        little2 <= {wide[53:28], |wide[27:0]};
        exponent2 <= exponent1;
        {sign2, minus2, nan2, infinite2, zero2} <= {sign1, minus1, nan1, infinite1, zero1};
    end
    reg [27:0] sum3;
    reg [8:0] exponent3;
    reg sign3, nan3, infinite3, zero3;
    always @(posedge clk) begin
        sum3 <= minus2 ? {1'b0, big2, 3'd0} - {1'b0, little2} : {1'b0, big2, 3'd0} + {1'b0, little2};
        exponent3 <= exponent2;
        {sign3, nan3, infinite3, zero3} <= {sign2, nan2, infinite2, zero2};
    end
    // Zeros ahead of the leading one, from bit 27 on.
    reg [4:0] zeros;
    integer i;
    always @* begin
        zeros = 5'd28;
        for (i = 0; i < 28; i = i + 1) if (sum3[i]) zeros = 5'd27 - i[4:0];
    end
    reg [27:0] sum4;
    reg [4:0] zeros4;
    reg [8:0] exponent4;
    reg sign4, nan4, infinite4, zero4;
    always @(posedge clk) begin
        sum4 <= sum3;
        zeros4 <= zeros;
        exponent4 <= exponent3;
        {sign4, nan4, infinite4, zero4} <= {sign3, nan3, infinite3, zero3};
    end
    wire [27:0] shifted = sum4 << zeros4;
    reg [27:0] sum5;
    reg [8:0] exponent5;
    reg sign5, nan5, infinite5, nothing5, zero5;
    always @(posedge clk) begin
        sum5 <= shifted;
        exponent5 <= exponent4 + 9'd1 - {4'd0, zeros4};
        nothing5 <= sum4 == 0;
        {sign5, nan5, infinite5, zero5} <= {sign4, nan4, infinite4, zero4};
    end
    wire up = sum5[3] & (sum5[4] | |sum5[2:0]);
    wire [24:0] rounded = {1'b0, sum5[27:4]} + {24'd0, up};
    wire [8:0] exponent6 = exponent5 + {8'd0, rounded[24]};
    always @(posedge clk)
        z <= nan5 ? {1'b0, 9'd511, 1'b1, 22'd0}
           : infinite5 | (exponent6 > 9'd383 & !nothing5) ? {sign5, 9'd511, 23'd0}
           : nothing5 ? {zero5, 32'd0}
           : {sign5, exponent6, rounded[24] ? 23'd0 : rounded[22:0]};
endmodule

// How many places further up than that of a normal number the last place is of what is subnormal outside, 25 at most;
// 31: nothing is left. Combinational.
module fp_places (
    input wire signed [10:0] exponent,  // as inside
    output wire [4:0] places
);
    wire signed [10:0] below = 11'sd130 - exponent;
    assign places = below < 0 ? 5'd0 : below > 24 ? 5'd31 : below[4:0];
endmodule

// Rounds a significand with a leading one, a bit after it and whether anything is left, where float32 has its last
// place. Two stages.
module fp_round (
    input wire clk,
    input wire sign,
    input wire signed [10:0] exponent,  // as inside
    input wire [4:0] places,  // of this exponent
    input wire [25:0] value,
    input wire nan,
    input wire infinite,
    input wire zero,
    output reg [32:0] z
);
    // The bits that are dropped, the first of them, and the last that is kept. Each is a function of `places` only.
    wire [27:0] dropped = ~(28'hFFFFFFC << places), half = 28'd2 << places, least = 28'd4 << places;
    wire [27:0] whole = {2'b00, value};
    wire up = |(whole & half) & (|(whole & least) | |(whole & dropped & ~half));
    reg [27:0] kept1, unit1;
    reg signed [10:0] exponent1;
    reg sign1, nan1, infinite1, zero1;
    always @(posedge clk) begin
        kept1 <= whole & ~dropped;
        unit1 <= up ? least : 28'd0;
        exponent1 <= exponent;
        {sign1, nan1, infinite1} <= {sign, nan, infinite};
        zero1 <= zero | places == 5'd31;
    end
    wire [27:0] rounded = kept1 + unit1;
    wire signed [10:0] exponent2 = exponent1 + {10'd0, rounded[26]};
    wire [22:0] fraction = rounded[26] ? 23'd0 : rounded[24:2];
    always @(posedge clk)
        z <= nan1 ? {1'b0, 9'd511, 1'b1, 22'd0}
           : infinite1 | (!zero1 & exponent2 > 383) ? {sign1, 9'd511, 23'd0}
           : zero1 | rounded == 0 ? {sign1, 32'd0}
           : {sign1, exponent2[8:0], fraction};
endmodule

// Product.
module fp_mul (
    input wire clk,
    input wire [32:0] a,
    input wire [32:0] b,
    output wire [32:0] z
);
    wire a_zero = a[31:23] == 0, b_zero = b[31:23] == 0;
    wire a_special = a[31:23] == 9'd511, b_special = b[31:23] == 9'd511;
    wire [23:0] x = {1'b1, a[22:0]}, y = {1'b1, b[22:0]};
    reg [35:0] low1;  // parts that a multiplier of 18 bits has
    reg [23:0] cross1, across1;
    reg [11:0] high1;
    reg [47:0] product2;
    reg signed [10:0] exponent1, exponent2;
    reg sign1, nan1, infinite1, zero1, sign2, nan2, infinite2, zero2;
    wire [4:0] places_low, places_high;  // of this exponent, of one more
    reg [4:0] low2, high2;
    fp_places low (exponent1, places_low);
    fp_places high (exponent1 + 11'sd1, places_high);
    always @(posedge clk) begin
        {high2, low2} <= {places_high, places_low};
        low1 <= x[17:0] * y[17:0];
        cross1 <= x[17:0] * y[23:18];
        across1 <= x[23:18] * y[17:0];
        high1 <= x[23:18] * y[23:18];
        exponent1 <= $signed({2'b00, a[31:23]}) + $signed({2'b00, b[31:23]}) - 11'sd256;
        sign1 <= a[32] ^ b[32];
        nan1 <= (a_special & a[22]) | (b_special & b[22]) | (a_special & b_zero) | (b_special & a_zero);
        infinite1 <= a_special | b_special;
        zero1 <= a_zero | b_zero;
        product2 <= {high1, low1} + {5'd0, {1'b0, cross1} + {1'b0, across1}, 18'd0};
        exponent2 <= exponent1;
        {sign2, nan2, infinite2, zero2} <= {sign1, nan1, infinite1, zero1};
    end
    reg [25:0] value3;
    reg signed [10:0] exponent3;
    reg [4:0] places3;
    reg sign3, nan3, infinite3, zero3;
    always @(posedge clk) begin
        places3 <= product2[47] ? high2 : low2;
        value3 <= product2[47] ? {product2[47:23], |product2[22:0]} : {product2[46:22], |product2[21:0]};
        exponent3 <= exponent2 + {10'd0, product2[47]};
        {sign3, nan3, infinite3, zero3} <= {sign2, nan2, infinite2, zero2};
    end
    fp_round round (clk, sign3, exponent3, places3, value3, nan3, infinite3, zero3, z);
endmodule

// Quotient: 26 bits of it, two in each of 13 stages.
module fp_div (
    input wire clk,
    input wire [32:0] a,
    input wire [32:0] b,
    output wire [32:0] z
);
    localparam STAGES = 13;
    wire a_zero = a[31:23] == 0, b_zero = b[31:23] == 0;
    wire a_special = a[31:23] == 9'd511, b_special = b[31:23] == 9'd511;
    wire signed [10:0] difference = $signed({2'b00, a[31:23]}) - $signed({2'b00, b[31:23]}) + 11'sd256;
    wire nan = (a_special & a[22]) | (b_special & b[22]) | (a_special & b_special) | (a_zero & b_zero);
    wire infinite = a_special | b_zero, zero = a_zero | b_special;

    reg [25:0] rest[0:STAGES];
    reg [23:0] divisor[0:STAGES];
    reg [25:0] quotient[0:STAGES];
    reg [14:0] others[0:STAGES];  // sign, exponent, nan, infinite, zero
    always @* begin
        rest[0] = {2'b00, 1'b1, a[22:0]};
        divisor[0] = {1'b1, b[22:0]};
        quotient[0] = 0;
        others[0] = {a[32] ^ b[32], difference, nan, infinite, zero};
    end
    genvar k;
    generate
        for (k = 0; k < STAGES; k = k + 1) begin : stage
            wire [25:0] by = {2'b00, divisor[k]};
            wire first = rest[k] >= by;
            wire [25:0] after = (first ? rest[k] - by : rest[k]) << 1;
            wire second = after >= by;
            always @(posedge clk) begin
                rest[k+1] <= (second ? after - by : after) << 1;
                divisor[k+1] <= divisor[k];
                quotient[k+1] <= {quotient[k][23:0], first, second};
                others[k+1] <= others[k];
            end
        end
    endgenerate
    wire [25:0] found = quotient[STAGES];
    wire left = rest[STAGES] != 0;
    wire signed [10:0] so_far = $signed(others[STAGES-1][13:3]);
    wire [4:0] places_low, places_high;
    reg [4:0] low, high, places;  // of one less than this exponent, and of this
    fp_places at_low (so_far - 11'sd1, places_low);
    fp_places at_high (so_far, places_high);
    reg [25:0] value;
    reg signed [10:0] exponent;
    reg sign1, nan1, infinite1, zero1;
    always @(posedge clk) begin
        {high, low} <= {places_high, places_low};
        places <= found[25] ? high : low;
        value <= found[25] ? {found[25:1], found[0] | left} : {found[24:0], left};
        exponent <= $signed(others[STAGES][13:3]) - {10'd0, !found[25]};
        {sign1, nan1, infinite1, zero1} <= {others[STAGES][14], others[STAGES][2:0]};
    end
    fp_round round (clk, sign1, exponent, places, value, nan1, infinite1, zero1, z);
endmodule

// Square root: 26 bits of it, two in each of 13 stages.
module fp_sqrt (
    input wire clk,
    input wire [32:0] a,
    output wire [32:0] z
);
    localparam STAGES = 13;
    wire zero = a[31:23] == 0, special = a[31:23] == 9'd511;
    wire nan = (special & a[22]) | (a[32] & !zero);
    wire odd = a[23];
    wire [24:0] radicand = odd ? {1'b1, a[22:0], 1'b0} : {2'b01, a[22:0]};
    // Half of the exponent, which lies 256 above that of the value.
    wire signed [10:0] half = $signed({3'b000, a[31:24]}) + 11'sd128;

    reg [51:0] left[0:STAGES];  // of the radicand
    reg [28:0] rest[0:STAGES];
    reg [25:0] root[0:STAGES];
    reg [14:0] others[0:STAGES];
    always @* begin
        left[0] = {radicand, 27'd0};
        rest[0] = 0;
        root[0] = 0;
        others[0] = {a[32], half, nan, special, zero};
    end
    genvar k;
    generate
        for (k = 0; k < STAGES; k = k + 1) begin : stage
            wire [28:0] one = {rest[k][26:0], left[k][51:50]}, by = {1'b0, root[k], 2'b01};
            wire first = one >= by;
            wire [28:0] after = first ? one - by : one;
            wire [25:0] between = {root[k][24:0], first};
            wire [28:0] two = {after[26:0], left[k][49:48]}, next = {1'b0, between, 2'b01};
            wire second = two >= next;
            always @(posedge clk) begin
                rest[k+1] <= second ? two - next : two;
                root[k+1] <= {between[24:0], second};
                left[k+1] <= left[k] << 4;
                others[k+1] <= others[k];
            end
        end
    endgenerate
    wire [25:0] value = {root[STAGES][25:1], root[STAGES][0] | rest[STAGES] != 0};
    wire [14:0] last = others[STAGES];
    // No root is subnormal.
    fp_round round (clk, last[14], $signed(last[13:3]), 5'd0, value, last[2], last[1], last[0], z);
endmodule

// The exponent of a > 0, as a number, that goes with a mantissa in [sqrt(1/2), sqrt(2)).
module fp_exponent (
    input wire clk,
    input wire [32:0] a,
    output reg [32:0] z
);
    wire signed [9:0] as_low = $signed({1'b0, a[31:23]}) - 10'sd256, as_high = $signed({1'b0, a[31:23]}) - 10'sd255;
    reg signed [9:0] exponent1;
    reg [9:0] size2;
    reg sign2;
    reg [3:0] top;  // the place of its leading one
    integer i;
    always @* begin
        top = 0;
        for (i = 0; i < 10; i = i + 1) if (size2[i]) top = i[3:0];
    end
    wire [22:0] fraction = {size2[8:0], 14'd0} << (4'd9 - top);
    always @(posedge clk) begin
        exponent1 <= a[22:0] < `ORIGIN ? as_low : as_high;
        size2 <= exponent1 < 0 ? -exponent1 : exponent1;
        sign2 <= exponent1 < 0;
        z <= size2 == 0 ? 33'd0 : {sign2, 9'd256 + {5'd0, top}, fraction};
    end
endmodule

// What moves or takes apart numbers, or was computed by the units above. One stage.
//     0  a < b ? yes : no, and a < b     1  |b| with the sign of a
//     2  the mantissa of a > 0, in [sqrt(1/2), sqrt(2))
//     3  a·2^n, n being the integer in the last places of b = n + 1.5·2^23
//     4, 5, 6  exponent, quotient, root     7  no
module fp_choose (
    input wire clk,
    input wire [2:0] what,
    input wire [32:0] a,
    input wire [32:0] b,
    input wire [32:0] yes,
    input wire [32:0] no,
    input wire [32:0] exponent,
    input wire [32:0] quotient,
    input wire [32:0] root,
    output reg [32:0] z,
    output reg less
);
    wire nan = (a[31:23] == 9'd511 & a[22]) | (b[31:23] == 9'd511 & b[22]);
    wire both_zero = a[31:23] == 0 & b[31:23] == 0;
    wire smaller = a[31:0] < b[31:0], larger = b[31:0] < a[31:0];
    wire below = !nan & !both_zero & (a[32] ? !b[32] | larger : !b[32] & smaller);
    wire low = a[22:0] < `ORIGIN;

    always @(posedge clk) begin
        less <= below;
        case (what)
            3'd0: z <= below ? yes : no;
            3'd1: z <= {a[32], b[31:0]};
            3'd2: z <= {1'b0, low ? 9'd256 : 9'd255, a[22:0]};
            3'd3: z <= {a[32], a[31:23] + b[8:0], a[22:0]};
            3'd4: z <= exponent;
            3'd5: z <= quotient;
            3'd6: z <= root;
            default: z <= no;
        endcase
    end
endmodule
`default_nettype wire
