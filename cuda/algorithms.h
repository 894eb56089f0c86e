#pragma once
// The device half of common/parallel/algorithms.h, where the arguments are explained.

#include <cstddef>
#include <cstdint>

namespace trilha::cuda {

template <class T, class Operation>
T reduce(void* stream, const T* values, std::size_t n, T start, Operation operation);
template <class T>
void exclusive_scan(void* stream, const T* values, T* sums, std::size_t n);
template <class Key>
void sort_by_key(void* stream, Key* keys, std::uint32_t* values, std::size_t n, int key_bits);
std::size_t compact(void* stream, const std::uint8_t* flags, std::size_t n, std::uint32_t* indices);

}  // namespace trilha::cuda
