#include "wheel/two_stage_exchange.h"

#include <algorithm>

#include "tuned.h"

namespace fretwave::wheel {

namespace {

const Tuned direct("exchange_direct", 5, "ranks up to which each sends to each other by itself");

/// Numbers that travel for another rank: to it in the first stage, from it in the second.
struct Parcel {
  int rank;
  std::span<double const> numbers;
};

void pack(Parcel const& parcel, std::vector<double>& into) {
  if (parcel.numbers.empty()) return;
  into.insert(into.end(), {double(parcel.rank), double(parcel.numbers.size())});
  into.insert(into.end(), parcel.numbers.begin(), parcel.numbers.end());
}

template <class Visit>
void for_parcels(std::span<double const> message, Visit visit) {
  while (!message.empty()) {
    const auto count = size_t(message[1]);
    visit(Parcel{int(message[0]), message.subspan(2, count)});
    message = message.subspan(2 + count);
  }
}

}  // namespace

TwoStageExchange::TwoStageExchange(MPI_Comm comm)
    : comm_(comm),
      rank_(comm_rank(comm)),
      size_(comm_size(comm)),
      directly_(size_ <= direct.count()),
      columns_(1) {
  while (columns_ * columns_ < size_) ++columns_;
  for (int column = 0; column < columns_; ++column) members_.push_back(through(rank_, column));
  for (int r = 0; r < size_; ++r)
    if (through(r, rank_ % columns_) == rank_) senders_.push_back(r);
  for (int r = rank_ % columns_; r < size_; r += columns_) column_.push_back(r);
}

/// One message to each of `to`, and what each of `from` sends.
std::vector<TwoStageExchange::Buffer> TwoStageExchange::pass(std::vector<Buffer> out,
                                                             std::vector<int> const& to,
                                                             std::vector<int> const& from, int tag) const {
  std::vector<MPI_Request> requests;
  std::vector<Buffer> in(from.size());
  for (size_t k = 0; k < to.size(); ++k)
    if (to[k] != rank_)
      MPI_Isend(out[k].data(), int(out[k].size()), MPI_DOUBLE, to[k], tag, comm_, &requests.emplace_back());
  for (size_t k = 0; k < from.size(); ++k) {
    if (from[k] == rank_) continue;
    MPI_Status status;
    int count;
    MPI_Probe(from[k], tag, comm_, &status);
    MPI_Get_count(&status, MPI_DOUBLE, &count);
    in[k].resize(size_t(count));
    MPI_Recv(in[k].data(), count, MPI_DOUBLE, from[k], tag, comm_, MPI_STATUS_IGNORE);
  }
  MPI_Waitall(int(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  const auto self = [this](std::vector<int> const& ranks) {
    return std::ranges::find(ranks, rank_) - ranks.begin();
  };
  in[self(from)] = std::move(out[self(to)]);
  return in;
}

/// Without a copy but of what is this rank's own.
void TwoStageExchange::exchange_directly(std::span<double const> out, std::span<int const> sent,
                                         std::span<double> in) const {
  std::vector<MPI_Request> requests;
  std::span<double const> own;
  for (int r = 0; r < size_; out = out.subspan(sent[r++])) {
    if (r == rank_) own = out.first(sent[r]);
    if (r != rank_) MPI_Isend(out.data(), sent[r], MPI_DOUBLE, r, 1, comm_, &requests.emplace_back());
  }
  for (int r = 0; r < size_; ++r) {
    MPI_Status status;
    int count = int(own.size());
    if (r == rank_) {
      std::ranges::copy(own, in.begin());
    } else {
      MPI_Probe(r, 1, comm_, &status);
      MPI_Get_count(&status, MPI_DOUBLE, &count);
      MPI_Recv(in.data(), count, MPI_DOUBLE, r, 1, comm_, MPI_STATUS_IGNORE);
    }
    in = in.subspan(size_t(count));
  }
  MPI_Waitall(int(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
}

void TwoStageExchange::operator()(std::span<double const> out, std::span<int const> sent,
                                  std::span<double> in) const {
  if (directly_) return exchange_directly(out, sent, in);
  std::vector<Buffer> by_column(columns_), by_row(column_.size());
  for (int r = 0; r < size_; out = out.subspan(sent[r++]))
    pack({r, out.first(sent[r])}, by_column[r % columns_]);

  const auto passing = pass(std::move(by_column), members_, senders_, 1);
  for (size_t k = 0; k < passing.size(); ++k)
    for_parcels(passing[k], [&](Parcel const& parcel) {
      pack({senders_[k], parcel.numbers}, by_row[parcel.rank / columns_]);
    });

  const auto arrived = pass(std::move(by_row), column_, column_, 2);
  std::vector<std::span<double const>> from(size_);
  for (Buffer const& message : arrived)
    for_parcels(message, [&](Parcel const& parcel) { from[parcel.rank] = parcel.numbers; });
  auto next = in.begin();
  for (auto const& numbers : from) next = std::ranges::copy(numbers, next).out;
}

}  // namespace fretwave::wheel
