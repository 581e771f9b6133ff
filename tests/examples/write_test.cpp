#include <opencv2/core.hpp>

#include "../../examples/support/write_picture.hpp"
#include "../../examples/support/write_text.hpp"
#include "support/catch.hpp"
#include "support/full_disk.hpp"
#include "support/temporary_folder.hpp"

#if defined(__unix__)
TEST_CASE("A text or a picture that the disk has no room for is named, and not there", "[examples]") {
  const cfp_test::TemporaryFolder folder;
  const auto text = folder.path / "tables.md", picture = folder.path / "000007.png";
  cv::Mat noise(200, 200, CV_8U);
  cv::randu(noise, 0, 256);
  const auto write_both = [&] {
    return cfp_test::error_of([&] { cfp_examples::write_text(text, std::string(100000, 'x')); }) +
           cfp_test::error_of([&] { cfp_examples::write_picture(picture, noise); });
  };
  {
    const cfp_test::FullDisk full(4096);
    CHECK(write_both() == "cannot write " + text.string() + "cannot write " + picture.string());
  }
  CHECK_FALSE(std::filesystem::exists(text));
  CHECK_FALSE(std::filesystem::exists(picture));
  CHECK(write_both().empty());
  CHECK(std::filesystem::file_size(text) == 100000);
  CHECK(std::filesystem::file_size(picture) > 4096);
}
#endif
