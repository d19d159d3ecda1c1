// The controller behind SPI, mode 0: everything that README.md names, in transfers of 24 + WORD bits while cs_n is
// low.
//
//     bits, most significant first: 4 command, 12 index, 8 of no meaning, WORD a word, which comes back where it is
//     read
//     command 0  read the status: bit 0 ready, bits 1 to 3 that of the last step
//             1  write a word of the motion (index 0 to 3) or of the state (from 4 on)
//             2  write a word of the motion, then start a step
//             3  read a reported number or a word of the state
//             4  read the force: index 0 x, 1 y
//
//     clk must be at least 8 times as fast as sck, which begins four cycles of clk after cs_n falls; cs_n rises
//     between transfers. miso is always driven. A word is lost if it is written while the controller is not ready or
//     to an index that does not exist; a word read from such an index is undefined.
`default_nettype none
module fracgyro_spi #(
    parameter WORD = 32,
    parameter IN_BITS = 12,
    parameter OUT_BITS = 12
) (
    input wire clk,
    input wire reset,
    input wire sck,
    input wire cs_n,
    input wire mosi,
    output wire miso,
    output wire ready,
    // For a converter next to it, as those of fracgyro_controller.
    output wire force_valid,
    output wire [WORD-1:0] force_x,
    output wire [WORD-1:0] force_y
);
    reg [2:0] sck_seen, cs_seen;
    reg [1:0] mosi_seen;
    always @(posedge clk) begin
        sck_seen <= {sck_seen[1:0], sck};
        cs_seen <= {cs_seen[1:0], cs_n};
        mosi_seen <= {mosi_seen[0], mosi};
    end
    wire selected = !cs_seen[1];
    wire rises = selected & sck_seen[2:1] == 2'b01, falls = selected & sck_seen[2:1] == 2'b10;

    reg [6:0] count;  // of bits
    reg [WORD-1:0] taken, given;
    reg [3:0] command;
    reg [11:0] index;
    reg in_write, start;
    wire done;
    wire [2:0] status;
    wire [WORD-1:0] out_word;
    assign miso = given[WORD-1];
    wire last = rises & count == 7'd23 + WORD;
    always @(posedge clk) begin
        in_write <= last & (command == 4'd1 | command == 4'd2) & index >> IN_BITS == 0;
        start <= last & command == 4'd2;
        if (rises) begin
            taken <= {taken[WORD-2:0], mosi_seen[1]};
            count <= count + 7'd1;
            if (count == 7'd15) {command, index} <= {taken[14:0], mosi_seen[1]};
        end
        if (falls) begin
            if (count == 7'd24)
                case (command)
                    4'd0: given <= {{(WORD - 4) {1'b0}}, status, ready};
                    4'd3: given <= out_word;
                    default: given <= index[0] ? force_y : force_x;
                endcase
            else given <= given << 1;
        end
        if (!selected | reset) count <= 7'd0;
    end
    fracgyro_controller controller (
        .clk(clk),
        .reset(reset),
        .in_write(in_write),
        .in_index(index[IN_BITS-1:0]),
        .in_word(taken),
        .start(start),
        .ready(ready),
        .force_valid(force_valid),
        .force_x(force_x),
        .force_y(force_y),
        .done(done),
        .status(status),
        .out_index(index[OUT_BITS-1:0]),
        .out_word(out_word)
    );
endmodule
`default_nettype wire
