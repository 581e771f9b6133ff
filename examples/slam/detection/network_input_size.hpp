// The input size that a network's file states: OpenCV's dnn module keeps it to itself until a forward pass of that very
// size.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace cfp_slam {

// Walks the fields of a protobuf message within a stream: just enough to find an ONNX graph's inputs without reading
// its weights.
class ProtobufReader {
 public:
  ProtobufReader(std::istream& stream, std::streamoff end) : stream_(stream), end_(end) {}

  // Goes to the next field, past what was left of the last one. False at the end, or when the bytes are no protobuf.
  bool next() {
    if (field_end_ >= 0) stream_.seekg(field_end_);
    field_end_ = -1;
    std::uint64_t key = 0;
    if (!stream_ || stream_.tellg() >= end_ || !varint(key)) return false;
    number = key >> 3U;
    value = 0;
    switch (key & 7U) {
      case 0:
        return varint(value);
      case 1:
        return skip(8);
      case 2:
        return varint(value) && value <= static_cast<std::uint64_t>(end_) && skip(static_cast<std::streamoff>(value));
      case 5:
        return skip(4);
      default:
        return false;
    }
  }
  // The message in the current field; read it before next().
  [[nodiscard]] ProtobufReader message() const { return {stream_, field_end_}; }

  std::uint64_t number = 0;  // of the field
  std::uint64_t value = 0;   // of a varint, or the length of a message

 private:
  bool varint(std::uint64_t& v) {
    v = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const int byte = stream_.get();
      if (byte < 0) return false;
      v |= (static_cast<std::uint64_t>(byte) & 127U) << shift;
      if (byte < 128) return true;
    }
    return false;
  }
  bool skip(std::streamoff bytes) {
    field_end_ = stream_.tellg() + bytes;
    return field_end_ <= end_;
  }

  std::istream& stream_;
  std::streamoff end_, field_end_ = -1;
};

// The first input of the graph with the shape 1 x 3 x H x W
// (ModelProto.graph.input.type.tensor_type.shape.dim.dim_value), 0 x 0 when there is none or its size is left open.
inline cv::Size onnx_input_size(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(0, std::ios::end);
  const std::streamoff size = stream.tellg();
  stream.seekg(0);
  if (!stream) return {};
  for (ProtobufReader model(stream, size); model.next();) {
    if (model.number != 7) continue;
    for (ProtobufReader graph = model.message(); graph.next();) {
      if (graph.number != 11) continue;
      std::vector<std::uint64_t> dims;
      for (ProtobufReader info = graph.message(); info.next();) {
        if (info.number != 2) continue;
        for (ProtobufReader type = info.message(); type.next();) {
          if (type.number != 1) continue;
          for (ProtobufReader tensor = type.message(); tensor.next();) {
            if (tensor.number != 2) continue;
            for (ProtobufReader shape = tensor.message(); shape.next();) {
              if (shape.number != 1) continue;
              ProtobufReader dim = shape.message();
              dims.push_back(dim.next() && dim.number == 1 ? dim.value : 0);
            }
          }
        }
      }
      if (dims.size() == 4 && dims[0] <= 1 && dims[1] == 3 && dims[2] < 65536 && dims[3] < 65536)
        return {static_cast<int>(dims[3]), static_cast<int>(dims[2])};
    }
  }
  return {};
}

// width= and height= of a Darknet configuration.
inline cv::Size darknet_input_size(const std::filesystem::path& cfg) {
  std::ifstream stream(cfg);
  cv::Size size;
  for (std::string line; std::getline(stream, line);) {
    line.erase(std::remove_if(line.begin(), line.end(), [](char c) { return c == ' ' || c == '\t' || c == '\r'; }),
               line.end());
    const auto number = [&](const std::string& key) {
      return line.rfind(key, 0) == 0 ? std::atoi(line.c_str() + key.size()) : 0;
    };
    if (size.width == 0) size.width = number("width=");
    if (size.height == 0) size.height = number("height=");
  }
  return size;
}

}  // namespace cfp_slam
