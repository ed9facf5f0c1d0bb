// Replays calls of the kernel that golden.py wrote down, for machines on which there is no Python: reads them from the first
// file, and writes to the second what each returns and leaves in memory, addresses as zeros.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "interface.hpp"

namespace {

using Number = int64_t;
using Function = Number (*)(Number, Number, Number, Number, Number, Number, Number, Number, Number, Number, Number);

#define FUNCTION(name) {#name, reinterpret_cast<Function>(&name)}
const std::map<std::string, Function> kFunctions = {
    FUNCTION(contact_curation_solve_cones),
    FUNCTION(contact_curation_evaluate),
    FUNCTION(contact_curation_evaluate_bouncing),
    FUNCTION(contact_curation_evaluate_weighted),
    FUNCTION(contact_curation_descend),
    FUNCTION(contact_curation_descend_deep),
    FUNCTION(contact_curation_descend_deepvertex),
    FUNCTION(contact_curation_descend_end_to_end),
    FUNCTION(contact_time_step),
    FUNCTION(contact_time_step_bouncing),
    FUNCTION(contact_given_step),
    FUNCTION(contact_rollout),
    FUNCTION(contact_rollout_bouncing),
    FUNCTION(contact_curation_elementary),
    FUNCTION(contact_curation_powers),
};

struct Block {
  Number size;
  std::vector<Number> memory;
  char *at(Number offset) { return reinterpret_cast<char *>(memory.data()) + offset; }
};

struct Address {
  Number block, offset, target;
};

class Replay {
 public:
  Replay(const char *calls, const char *results) : in_(std::fopen(calls, "rb")), out_(std::fopen(results, "wb")) {
    if (!in_ || !out_) fail("cannot open its files");
  }

  void run() {
    for (Number left = number(); left > 0; --left) call();
    if (std::fclose(out_)) fail("cannot write");
  }

 private:
  [[noreturn]] static void fail(const char *why) {
    std::fprintf(stderr, "replay: %s\n", why);
    std::exit(1);
  }

  std::vector<Number> numbers(Number count) {
    std::vector<Number> read(static_cast<size_t>(count));
    if (std::fread(read.data(), sizeof(Number), read.size(), in_) != read.size()) fail("the calls end too early");
    return read;
  }
  Number number() { return numbers(1)[0]; }
  std::vector<Number> bytes(Number size) { return numbers((size + 7) / 8); }

  void call() {
    const Number length = number();
    const std::vector<Number> letters = bytes(length);
    const std::string name(reinterpret_cast<const char *>(letters.data()), static_cast<size_t>(length));
    const Number returned = number();
    std::vector<Block> blocks(static_cast<size_t>(number()));
    for (Block &block : blocks) {
      block.size = number();
      block.memory = bytes(block.size);
    }
    std::vector<Address> addresses(static_cast<size_t>(number()));
    for (Address &one : addresses) {
      one = {number(), number(), number()};
      const char *target = blocks[static_cast<size_t>(one.target)].at(0);
      std::memcpy(blocks[static_cast<size_t>(one.block)].at(one.offset), &target, sizeof target);
    }
    Number arguments[11] = {};
    const Number count = number();
    for (Number k = 0; k < count; ++k) {
      const bool is_block = number();
      const Number value = number();
      arguments[k] = is_block ? reinterpret_cast<Number>(blocks[static_cast<size_t>(value)].at(0)) : value;
    }
    const auto found = kFunctions.find(name);
    if (found == kFunctions.end()) fail(name.c_str());
    // A C function takes its arguments where they are, and does not look for further ones.
    const Number *a = arguments;
    Number result = found->second(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10]);
    if (returned == 0) result = 0;
    if (returned == 4) result = static_cast<int32_t>(result);
    for (const Address &one : addresses) std::memset(blocks[static_cast<size_t>(one.block)].at(one.offset), 0, sizeof(Number));
    std::fwrite(&result, sizeof result, 1, out_);
    for (Block &block : blocks) std::fwrite(block.at(0), 1, static_cast<size_t>(block.size), out_);
  }

  std::FILE *in_, *out_;
};

}  // namespace

int main(int count, char **words) {
  if (count != 3) return 2;
  Replay(words[1], words[2]).run();
}
