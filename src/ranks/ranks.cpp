#include "ranks/ranks.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <thread>

#include "backend/team.hpp"

namespace moraine {

namespace {

constexpr std::size_t most_at_once = std::size_t{1} << 28;  // bytes of a parcel; MPI counts in int

}  // namespace

void Ranks::wait(Message& message) {
  for (SpinWait spin; !done(message);) spin.once();
}

void Ranks::wait_at_rest(Message& message) {
  constexpr int turns_before_sleep = 20'000;
  for (SpinWait spin; !done(message);) {
    spin.once();
    if (spin.turns() > turns_before_sleep) std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

void Ranks::gather(void* all, const std::vector<std::size_t>& begin) {
  auto* const bytes = static_cast<std::byte*>(all);
  const auto size_of = [&](int r) { return begin[r + 1] - begin[r]; };
  std::vector<Message> messages;
  for (int r = 0; r < size(); ++r)
    if (r != rank()) messages.push_back(receive(r, Tag::gathered, bytes + begin[r], size_of(r)));
  for (int r = 0; r < size(); ++r)
    if (r != rank()) messages.push_back(send(r, Tag::gathered, bytes + begin[rank()], size_of(rank())));
  for (Message& m : messages) wait(m);
}

void Ranks::broadcast(void* bytes, std::size_t count) {
  std::vector<Message> messages;
  if (rank() > 0)
    messages.push_back(receive(0, Tag::gathered, bytes, count));
  else
    for (int r = 1; r < size(); ++r) messages.push_back(send(r, Tag::gathered, bytes, count));
  for (Message& m : messages) wait(m);
}

void Parcel::post(Ranks& ranks, int to) {
  size_ = bytes_.size();
  messages_.push_back(ranks.send(to, Tag::parcel, &size_, sizeof size_));
  for (std::size_t at = 0; at < size_; at += most_at_once)
    messages_.push_back(ranks.send(to, Tag::parcel, bytes_.data() + at, std::min(most_at_once, size_ - at)));
}

void Parcel::wait(Ranks& ranks) {
  for (Ranks::Message& m : messages_) ranks.wait(m);
  messages_.clear();
}

Parcel Parcel::from(Ranks& ranks, int from, bool at_rest) {
  std::size_t size = 0;
  Ranks::Message head = ranks.receive(from, Tag::parcel, &size, sizeof size);
  at_rest ? ranks.wait_at_rest(head) : ranks.wait(head);
  Parcel parcel;
  parcel.bytes_.resize(size);
  for (std::size_t at = 0; at < size; at += most_at_once) {
    Ranks::Message piece =
        ranks.receive(from, Tag::parcel, parcel.bytes_.data() + at, std::min(most_at_once, size - at));
    ranks.wait(piece);
  }
  return parcel;
}

void expect_well(Ranks* ranks, const std::string& words) {
  if (!ranks) {
    if (!words.empty()) throw Error(words);
    return;
  }
  const std::vector<char> failed = of_all(*ranks, static_cast<char>(!words.empty()));
  if (std::ranges::find(failed, 1) == failed.end()) return;
  std::array<char, 1024> text{};
  words.copy(text.data(), text.size() - 1);
  for (const auto& of : of_all(*ranks, text))
    if (of[0] != 0) throw SharedError(of.data());
}

}  // namespace moraine
