#include "log.h"

#include <array>

namespace fretwave::log {

namespace {

/// All that is told, by what it is part of: points of a branch, the motion and its contact, the linear
/// solves, the wheel.
constexpr std::array names{
    "FwPoint",     "FwRecord",       "FwTable",         "FwCurve",         "FwContactForce", "FwContactJacob",
    "FwSummary",   "FwStructure",    "FwContactBlocks", "FwErrorEstimate", "FwPCBuild",      "FwPCFollow",
    "FwBasis",     "FwStuckBasis",   "FwStaticBasis",   "FwBlocks",        "FwBorder",       "FwCompliance",
    "FwPairs",     "FwPairInverse",  "FwPairMotion",    "FwSlipInverse",   "FwElimination",  "FwEliminated",
    "FwFamilies",  "FwSectorFactor", "FwSectors",       "FwStatics",       "FwTransform",    "FwWaveBlocks",
    "FwWaveModes", "FwWaves"};

PetscClassId kind() {
  static const PetscClassId id = [] {
    PetscClassId made;
    check(PetscClassIdRegister("fretwave", &made));
    return made;
  }();
  return id;
}

}  // namespace

void register_events() {
  PetscLogEvent made;
  for (char const* name : names) check(PetscLogEventRegister(name, kind(), &made));
}

PetscLogEvent event_named(char const* name) {
  PetscLogEvent found = -1;
  check(PetscLogEventGetId(name, &found));
  if (found < 0) throw std::logic_error(std::string("no event of this name is registered: ") + name);
  return found;
}

}  // namespace fretwave::log
