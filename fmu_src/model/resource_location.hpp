// Where an importer has put the resources folder: from the URI that it passes to a path of this machine.
#pragma once

#include <string>
#include <string_view>

namespace mixed_order_game {

/// file:/p, file:///p, file://localhost/p (percent-encoded UTF-8; scheme and host in any case), or a plain path. Throws
/// Error for any other.
std::string path_of(std::string_view resource_location);

/// The bytes of a file, at most 64 MB. Throws Error naming the file.
std::string content_of(const std::string& path);

}  // namespace mixed_order_game
