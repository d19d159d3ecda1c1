// Every unit of fixed_units.v, from two's complement to two's complement.
module bench (
    input wire clk,
    input wire load_div,
    input wire load_sqrt,
    input wire [47:0] a,
    input wire [47:0] b,
    input wire what,
    output wire [47:0] sum,
    output wire [47:0] product,
    output wire [47:0] quotient,
    output wire [47:0] root,
    output wire [47:0] chosen,
    output wire [47:0] converted,
    output wire less
);
    wire [47:0] x, y, z_add, z_mul, z_div, z_sqrt, z_choose, z_integer;
    fx_in in_a (a, x);
    fx_in in_b (b, y);
    // Internally a 0 may have either sign.
    wire [47:0] u = {x[47] | (x[46:0] == 0 & b[0]), x[46:0]}, v = {y[47] | (y[46:0] == 0 & a[0]), y[46:0]};
    fx_add add (clk, u, v, z_add);
    fx_mul mul (clk, u, v, z_mul);
    fx_div div (clk, load_div, u, v, z_div);
    fx_sqrt square_root (clk, load_sqrt, u, z_sqrt);
    fx_choose choose (clk, {3'b000, what}, u, v, v, u, v, v, v, v, z_choose, less);
    fx_from_integer integer_to (clk, a, z_integer);
    fx_out out_add (z_add, sum);
    fx_out out_mul (z_mul, product);
    fx_out out_div (z_div, quotient);
    fx_out out_sqrt (z_sqrt, root);
    fx_out out_choose (z_choose, chosen);
    fx_out out_integer (z_integer, converted);
endmodule
