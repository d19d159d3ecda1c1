// Every unit of units.v, from float32 to float32.
module bench (
    input wire clk,
    input wire load_div,
    input wire load_sqrt,
    input wire [31:0] a,
    input wire [31:0] b,
    input wire [3:0] what,
    output wire [31:0] sum,
    output wire [31:0] product,
    output wire [31:0] quotient,
    output wire [31:0] root,
    output wire [31:0] exponent,
    output wire [31:0] chosen,
    output wire [31:0] converted,
    output wire less
);
    wire [32:0] x, y, z_add, z_mul, z_div, z_sqrt, z_exponent, z_choose, z_integer;
    wire [4:0] a_zeros, b_zeros;
    fp_zeros zeros_a (a, a_zeros);
    fp_zeros zeros_b (b, b_zeros);
    fp_in in_a (a, a_zeros, x);
    fp_in in_b (b, b_zeros, y);
    fp_add add (clk, x, y, z_add);
    fp_mul mul (clk, x, y, z_mul);
    fp_div div (clk, load_div, x, y, z_div);
    fp_sqrt square_root (clk, load_sqrt, x, z_sqrt);
    fp_exponent exponent_of (clk, x, z_exponent);
    fp_choose choose (clk, what, x, y, y, x, x, y, y, y, y, z_choose, less);
    fp_from_integer integer_to (clk, a, z_integer);
    fp_out out_add (z_add, sum);
    fp_out out_mul (z_mul, product);
    fp_out out_div (z_div, quotient);
    fp_out out_sqrt (z_sqrt, root);
    fp_out out_exponent (z_exponent, exponent);
    fp_out out_choose (z_choose, chosen);
    fp_out out_integer (z_integer, converted);
endmodule
