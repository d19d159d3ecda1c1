// Runs the fuzz target on corpus.jsonl, without the fuzzer: each line is an input, as a string of hexadecimal digits.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int, char** paths) {
    std::ifstream corpus(paths[1]);
    int count = 0;
    for (std::string line; std::getline(corpus, line); ++count) {
        std::vector<std::uint8_t> bytes;
        for (std::size_t i = 1; i + 2 < line.size(); i += 2) {  // between quotation marks
            bytes.push_back(static_cast<std::uint8_t>(std::stoi(line.substr(i, 2), nullptr, 16)));
        }
        LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    }
    std::printf("%d inputs\n", count);
}
