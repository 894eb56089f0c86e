#pragma once
// The CPU half of algorithms.h, where the arguments are explained.

#include <cstddef>
#include <cstdint>

namespace trilha::cpu {

template <class T, class Operation>
T reduce(const T* values, std::size_t n, T start, Operation operation);
template <class T>
void exclusive_scan(const T* values, T* sums, std::size_t n);
template <class Key>
void sort_by_key(Key* keys, std::uint32_t* values, std::size_t n);
std::size_t compact(const std::uint8_t* flags, std::size_t n, std::uint32_t* indices);

}  // namespace trilha::cpu
