// Pipelined arithmetic on IEEE 754 single precision, with the bits of a processor: subnormal numbers included, to the
// nearest, ties to even. Units take operands in every cycle; no unit is reset.
//
//     Inside, a number has 33 bits: sign, 9 bits of exponent, 23 bits of fraction. The exponent is that of the value
//     plus 256, also for numbers that are subnormal outside: every number except 0 has its leading one. Exponent 0:
//     zero. Exponent 511: infinity if the fraction is 0, else NaN, of which there is one.
//
//     Rounding adds to exponent and fraction as one number: a fraction that overflows carries into the exponent.
//
//     The stages of a unit, from its operands to a register with its result: fp_add 5, fp_mul 4, fp_div 12,
//     fp_sqrt 16, fp_exponent 3, fp_choose 1, fp_from_integer 4. fp_div and fp_sqrt (digits.v) take operands when their
//     digits have ended.
`default_nettype none
`define ORIGIN 23'h3504F3 // the fraction of sqrt(1/2)

// Zeros ahead of the leading one of a subnormal number. Combinational.
module fp_zeros (
    input wire [31:0] x,
    output reg [4:0] zeros
);
    integer i;
    always @* begin
        zeros = 0;
        for (i = 0; i < 23; i = i + 1) if (x[i]) zeros = 5'd22 - i[4:0];
    end
endmodule

// From float32. Combinational; its zeros are found before, as that takes as long again.
module fp_in (
    input wire [31:0] x,
    input wire [4:0] zeros,
    output wire [32:0] z
);
    wire [7:0] exponent = x[30:23];
    wire [22:0] fraction = x[22:0];
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
    wire [4:0] below = 5'd2 - exponent[4:0];  // 130 less the exponent, where that is subnormal
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
    reg sign1, sign2, sign3;
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
        exponent3 <= magnitude2 == 0 ? 9'd0 : 9'd287 - {4'd0, zeros2};
        {sign3, sign2, sign1} <= {sign2, sign1, x[31]};
    end
    wire up = shifted3[7] & (shifted3[8] | |shifted3[6:0]);
    always @(posedge clk) z <= {sign3, {exponent3, shifted3[30:8]} + {31'd0, up}};
endmodule

// Sum. Results that are subnormal outside are exact: there is nothing to round below 2^-149.
//
//     Two ways lead to the leading one of the sum. Near: a difference of numbers whose exponents differ by at most 1
//     may have many zeros ahead of it, and is found without shifting the smaller one far. Far: of all others it is at
//     most one place away.
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
    reg sign1, minus1, nan1, special1, zero1;
    always @(posedge clk) begin
        big1 <= {big[31:23] != 0, big[22:0]};
        little1 <= {little[31:23] != 0, little[22:0]};
        exponent1 <= big[31:23];
        distance1 <= swap ? b_over_a : a_over_b;
        sign1 <= big[32];
        minus1 <= a[32] ^ b[32];
        nan1 <= a_nan | b_nan | (both_infinite & (a[32] ^ b[32]));
        special1 <= a[31:23] == 9'd511 | b[31:23] == 9'd511;
        zero1 <= a[32] & b[32];  // the sign of a sum of zeros
    end
    // Far: the smaller one shifted, what falls out kept as one bit. Near: the difference.
    reg [25:0] coarse;
    reg lost;  // something fell out of `coarse`
    always @* case (distance1[4:3])
        2'd0: {coarse, lost} = {little1, 2'd0, 1'b0};
        2'd1: {coarse, lost} = {8'd0, little1[23:6], |little1[5:0]};
        2'd2: {coarse, lost} = {16'd0, little1[23:14], |little1[13:0]};
        default: {coarse, lost} = {24'd0, little1[23:22], |little1[21:0]};
    endcase
    wire [32:0] fine = {coarse, 7'd0} >> distance1[2:0];
    reg [23:0] big2;
    reg [26:0] little2;
    reg [24:0] near2;
    reg [8:0] exponent2;
    reg sign2, minus2, nan2, special2, zero2, is_near2;
    always @(posedge clk) begin
        big2 <= big1;
        little2 <= distance1[8:5] != 0 ? {26'd0, little1[23]} : {fine[32:7], lost | |fine[6:0]};
        near2 <= {big1, 1'b0} - (distance1[0] ? {1'b0, little1} : {little1, 1'b0});
        is_near2 <= minus1 & distance1[8:1] == 0;
        exponent2 <= exponent1;
        {sign2, minus2, nan2, special2, zero2} <= {sign1, minus1, nan1, special1, zero1};
    end
    // Far: the sum. Near: zeros ahead of the leading one, eight at a time.
    wire [31:0] ahead = {near2, 7'd0};
    wire [2:0] empty = {ahead[31:24] == 0, ahead[23:16] == 0, ahead[15:8] == 0};
    wire [1:0] eights = !empty[2] ? 2'd0 : !empty[1] ? 2'd1 : !empty[0] ? 2'd2 : 2'd3;
    wire [2:0] ones0, ones1, ones2;
    fp_ahead of_first (ahead[31:25], ones0);
    fp_ahead of_second (ahead[23:17], ones1);
    fp_ahead of_third (ahead[15:9], ones2);
    reg [27:0] sum3;
    reg [24:0] near3;
    reg [4:0] zeros3;
    reg [8:0] exponent3;
    reg sign3, nan3, special3, is_near3, nothing3;
    always @(posedge clk) begin
        sum3 <= minus2 ? {1'b0, big2, 3'd0} - {1'b0, little2} : {1'b0, big2, 3'd0} + {1'b0, little2};
        case (eights)
            2'd0: {near3, zeros3} <= {ahead[31:7], eights, ones0};
            2'd1: {near3, zeros3} <= {ahead[23:0], 1'd0, eights, ones1};
            2'd2: {near3, zeros3} <= {ahead[15:0], 9'd0, eights, ones2};
            default: {near3, zeros3} <= {ahead[7:0], 17'd0, eights, 3'd0};
        endcase
        nothing3 <= is_near2 ? near2 == 0 : !big2[23];
        exponent3 <= exponent2;
        // The sign of a difference of equal numbers is plus; a sum of zeros has their sign.
        sign3 <= !nan2 & ((is_near2 ? near2 == 0 : !big2[23]) ? zero2 : sign2);
        {nan3, special3, is_near3} <= {nan2, special2, is_near2};
    end
    // The leading one at bit 27.
    wire [24:0] near = near3 << zeros3[2:0];
    wire [27:0] far = sum3[27] ? sum3 : sum3[26] ? {sum3[26:0], 1'b0} : {sum3[25:0], 2'b00};
    wire [8:0] more = is_near3 ? -{4'd0, zeros3} : sum3[27] ? 9'd1 : sum3[26] ? 9'd0 : -9'd1;
    wire [8:0] sum_exponent = exponent3 + more;
    reg [27:0] sum4;
    reg [8:0] exponent4;
    reg sign4, nan4;
    always @(posedge clk) begin
        sum4 <= special3 ? 28'd0 : is_near3 ? {near, 3'd0} : far;
        exponent4 <= special3 ? 9'd511 : nothing3 ? 9'd0 : sum_exponent;
        {sign4, nan4} <= {sign3, nan3};
    end
    wire up = sum4[3] & (sum4[4] | |sum4[2:0]);
    fp_last last (clk, sign4, exponent4, sum4[26:4], 23'd0, up, 1'b0, nan4, z);
endmodule

// Zeros ahead of the first one of seven bits and a one. Combinational.
module fp_ahead (
    input wire [6:0] x,
    output reg [2:0] zeros
);
    always @* casez (x)
        7'b1??????: zeros = 3'd0;
        7'b01?????: zeros = 3'd1;
        7'b001????: zeros = 3'd2;
        7'b0001???: zeros = 3'd3;
        7'b00001??: zeros = 3'd4;
        7'b000001?: zeros = 3'd5;
        7'b0000001: zeros = 3'd6;
        default: zeros = 3'd7;
    endcase
endmodule

// The last stage: adds one at the last place, or nothing. An exponent that then is more than 383 is that of infinity.
module fp_last (
    input wire clk,
    input wire sign,
    input wire [8:0] exponent,
    input wire [22:0] fraction,  // with ones where places are dropped
    input wire [22:0] dropped,
    input wire up,
    input wire none,  // 0 unless it is rounded up
    input wire nan,
    output reg [32:0] z
);
    wire [31:0] sum = {exponent, fraction} + {31'd0, up};
    always @(posedge clk) begin
        z[32] <= sign;
        z[31:23] <= none & !up ? 9'd0 : sum[31:23] | {9{sum[31] & sum[30]}};
        // An overflow in this sum leaves no fraction.
        z[22:0] <= exponent[8] & exponent[7] ? {nan, 22'd0} : sum[22:0] & ~dropped;
    end
endmodule

// Which places of a significand are dropped, and the first of them, where float32 has its last place. Combinational.
module fp_places (
    input wire signed [10:0] below,  // how far the exponent is below that of the least normal number
    output wire [25:0] dropped,
    output wire [25:0] first
);
    wire none = below < 1, all = !none & below[9:5] != 0;
    genvar k;
    generate
        for (k = 1; k < 26; k = k + 1) begin : place
            assign dropped[k] = all | (!none & below[4:0] >= k);
            assign first[k] = !none & !all & below[4:0] == k;
        end
    endgenerate
    assign dropped[0] = 1'b1;
    assign first[0] = none;
endmodule

// Rounds a significand in [1/2, 2) where float32 has its last place. Two stages.
module fp_round (
    input wire clk,
    input wire sign,
    input wire signed [10:0] exponent,  // internal format, for a significand below 1, doubled
    input wire [25:0] dropped,  // fraction bits that this exponent drops
    input wire [25:0] first,
    input wire [25:0] value,
    input wire left,  // something after it is not 0
    input wire nan,
    input wire infinite,
    input wire zero,
    output wire [32:0] z
);
    // A normal number that is 1 or more has one place more to drop.
    wire high = value[25];
    wire [25:0] drop = {dropped[25:2], dropped[1] | high, 1'b1};
    wire [25:0] half = {first[25:2], first[1] | (first[0] & high), first[0] & !high};
    wire odd = |(value[25:1] & half[24:0]), more = left | |(value[24:0] & drop[25:1]);
    wire [25:0] ones = value | drop;
    wire over = !exponent[10] & (exponent[9] | (exponent[8] & exponent[7]));
    reg [22:0] fraction1, dropped1;
    reg [8:0] exponent1;
    reg sign1, up1, none1, nan1;
    always @(posedge clk) begin
        {sign1, nan1} <= {sign & !nan, nan};
        up1 <= |(value & half) & (odd | more);
        fraction1 <= high ? ones[24:2] : ones[23:1];
        dropped1 <= high ? drop[24:2] : drop[23:1];
        none1 <= high ? drop[25] : drop[24];
        exponent1 <= exponent[8:0] + {8'd0, high};
        if (nan | infinite | over | zero) begin
            {up1, none1, fraction1} <= 0;
            exponent1 <= nan | infinite | over ? 9'd511 : 9'd0;
        end
    end
    fp_last last (clk, sign1, exponent1, fraction1, dropped1, up1, none1, nan1, z);
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
    reg signed [10:0] exponent1, exponent2, below1;
    reg sign1, nan1, infinite1, zero1, sign2, nan2, infinite2, zero2;
    wire [25:0] dropped, first;
    reg [25:0] dropped2, first2;
    fp_places places (below1, dropped, first);
    // Three numbers as two, bit by bit.
    wire [29:0] p = {high1, low1[35:18]}, q = {6'd0, cross1}, r = {6'd0, across1};
    wire [29:0] carries = (p & q) | (p & r) | (q & r);
    always @(posedge clk) begin
        low1 <= x[17:0] * y[17:0];
        cross1 <= x[17:0] * y[23:18];
        across1 <= x[23:18] * y[17:0];
        high1 <= x[23:18] * y[23:18];
        exponent1 <= $signed({2'b00, a[31:23]}) + $signed({2'b00, b[31:23]}) - 11'sd256;
        below1 <= 11'sd386 - $signed({2'b00, a[31:23]}) - $signed({2'b00, b[31:23]});
        sign1 <= a[32] ^ b[32];
        nan1 <= (a_special & a[22]) | (b_special & b[22]) | (a_special & b_zero) | (b_special & a_zero);
        infinite1 <= a_special | b_special;
        zero1 <= a_zero | b_zero;
        product2 <= {(p ^ q ^ r) + {carries[28:0], 1'b0}, low1[17:0]};
        exponent2 <= exponent1;
        {dropped2, first2} <= {dropped, first};
        {sign2, nan2, infinite2, zero2} <= {sign1, nan1, infinite1, zero1};
    end
    wire left = |product2[21:0];
    fp_round round (clk, sign2, exponent2, dropped2, first2, product2[47:22], left, nan2, infinite2, zero2, z);
endmodule

// Quotient, from `load` on.
module fp_div (
    input wire clk,
    input wire load,
    input wire [32:0] a,
    input wire [32:0] b,
    output wire [32:0] z
);
    wire a_zero = a[31:23] == 0, b_zero = b[31:23] == 0;
    wire a_special = a[31:23] == 9'd511, b_special = b[31:23] == 9'd511;
    reg signed [10:0] exponent;  // exponent of a quotient below 1, doubled
    reg sign, nan, infinite, zero;
    always @(posedge clk)
        if (load) begin
            exponent <= $signed({2'b00, a[31:23]}) - $signed({2'b00, b[31:23]}) + 11'sd255;
            sign <= a[32] ^ b[32];
            nan <= (a_special & a[22]) | (b_special & b[22]) | (a_special & b_special) | (a_zero & b_zero);
            infinite <= a_special | b_zero;
            zero <= a_zero | b_special;
        end
    wire [26:0] quotient;
    wire inexact;
    quotient_digits #(24, 9) digits (clk, load, {2'b01, a[22:1]}, {a[0], 26'd0}, {1'b1, b[22:0]}, quotient, inexact);
    wire [25:0] dropped, first;
    reg signed [10:0] below;
    reg [25:0] dropped_last, first_last;
    fp_places places (below, dropped, first);
    always @(posedge clk) begin
        below <= 11'sd130 - exponent;
        {dropped_last, first_last} <= {dropped, first};
    end
    fp_round round (clk, sign, exponent, dropped_last, first_last, quotient[26:1], inexact | quotient[0], nan,
        infinite, zero, z);
endmodule

// Square root, from `load` on.
module fp_sqrt (
    input wire clk,
    input wire load,
    input wire [32:0] a,
    output wire [32:0] z
);
    wire nothing = a[31:23] == 0;
    wire [24:0] radicand = a[23] ? {1'b1, a[22:0], 1'b0} : {2'b01, a[22:0]};
    reg signed [10:0] half;  // half the exponent, which is the value's plus 256; for a root below 1, doubled
    reg sign, nan, special, zero;
    always @(posedge clk)
        if (load) begin
            half <= $signed({3'b000, a[31:24]}) + 11'sd127;
            sign <= a[32];
            nan <= (a[31:23] == 9'd511 & a[22]) | (a[32] & !nothing);
            special <= a[31:23] == 9'd511;
            zero <= nothing;
        end
    wire [25:0] root;
    wire inexact;
    root_digits #(13) digits (clk, load, {radicand, 27'd0}, root, inexact);
    // No root is subnormal, or below 1.
    fp_round round (clk, sign, half, 26'd1, 26'd1, root, inexact, nan, special, zero, z);
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
//     4 to 8  exponent, quotients, roots
module fp_choose (
    input wire clk,
    input wire [3:0] what,
    input wire [32:0] a,
    input wire [32:0] b,
    input wire [32:0] yes,
    input wire [32:0] no,
    input wire [32:0] exponent,
    input wire [32:0] quotient0,
    input wire [32:0] quotient1,
    input wire [32:0] root0,
    input wire [32:0] root1,
    output reg [32:0] z,
    output reg less
);
    wire nan = (a[31:23] == 9'd511 & a[22]) | (b[31:23] == 9'd511 & b[22]);
    wire both_zero = a[31:23] == 0 & b[31:23] == 0;
    wire smaller, larger;
    compare #(32) sizes (a[31:0], b[31:0], smaller, larger);
    wire below = !nan & !both_zero & (a[32] ? !b[32] | larger : !b[32] & smaller);
    wire low = a[22:0] < `ORIGIN;

    // One of sixteen, chosen by the bits of `what` as they are.
    wire [32:0] signed_as = {a[32], b[31:0]}, mantissa = {1'b0, low ? 9'd256 : 9'd255, a[22:0]};
    wire [32:0] scaled = {a[32], a[31:23] + b[8:0], a[22:0]};
    wire [16*33-1:0] each = {{7{no}}, root1, root0, quotient1, quotient0, exponent, scaled, mantissa, signed_as, no};
    wire [32:0] others = each[what*33+:33];
    always @(posedge clk) begin
        less <= below;
        z <= below & what == 4'd0 ? yes : others;
    end
endmodule
`default_nettype wire
