#include "fault.h"

#include <cstdlib>
#include <new>
#include <sstream>
#include <stdexcept>

#include "error.h"

namespace fretwave::fault {

namespace {

std::string armed_place, armed_kind;
int remaining = 0;

}  // namespace

namespace detail {

bool armed = false;

bool meets(char const* place, bool value) {
  if (armed_place != place || (armed_kind == "value") != value || --remaining > 0) return false;
  armed = false;  // once
  return true;
}

void raise(char const* place) {
  const std::string text = std::string("injected fault at ") + place;
  if (armed_kind == "memory") throw std::bad_alloc();
  if (armed_kind == "input") throw InputError(text, "fault", "none", "unset FRETWAVE_FAULT");
  throw std::runtime_error(text);
}

}  // namespace detail

void arm(std::string const& place, std::string const& kind, int count) {
  if (kind != "error" && kind != "input" && kind != "memory" && kind != "value")
    throw InputError("unknown kind of fault", kind, "error, input, memory or value", "unset FRETWAVE_FAULT");
  armed_place = place, armed_kind = kind, remaining = count;
  detail::armed = !place.empty() && count > 0;
}

void arm_from(char const* text, int rank) {
  if (!text || !*text) return;
  std::istringstream in(text);
  std::string place, kind, count, at;
  std::getline(in, place, ':'), std::getline(in, kind, ':'), std::getline(in, count, ':'),
      std::getline(in, at);
  if (at == std::to_string(rank)) arm(place, kind, std::atoi(count.c_str()));
}

}  // namespace fretwave::fault
