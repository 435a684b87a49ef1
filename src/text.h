#pragma once
#include <cstdio>
#include <string>

namespace fretwave {

/// A number as messages show it.
inline std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

}  // namespace fretwave
