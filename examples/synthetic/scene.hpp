// The room: x to the right, y away from the camera, z up, metres; the floor is z = 0 and the desk stands around the
// origin. Near structure (desk, chairs, side tables) lies 2 to 3.5 m from the camera, cabinets at 5 to 6 m, the back
// wall at 6.9 m, where depth fails in half of the pixels.
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "surfaces.hpp"
#include "textures.hpp"

namespace synthetic {

struct Scene {
  std::vector<Texture> textures;
  std::vector<Surface> surfaces;  ///< static ones
  int shirts[2]{}, trousers[2]{}, heads[2]{}, skins[2]{}, shoes = 0;
};

/// What the scene and the people's scripts agree about.
struct Stage {
  bool room = true;        ///< false: the people are put into a real recording
  bool furniture = false;  ///< stands between the camera and the people
  struct Chair {
    double x, y, heading;  ///< where one looks on it, from +x
  } chairs[2] = {{-0.95, -0.95, 0.9}, {0.95, -0.95, 3.14159265358979 - 0.9}};
  double lanes[2] = {-1.82, -1.5};  ///< y on which they walk; chairs reach to -1.2, the camera to -2.45
  double front = -2.3;              ///< y of the nearest that they come in a close-up
};

constexpr double seat_height = 0.46;

class SceneBuilder {
 public:
  explicit SceneBuilder(std::uint64_t seed) : random_(seed, "textures") {}

  /// Textures of the people and the room; without it only the chairs (for composing into a real recording).
  Scene build(const Stage& stage) {
    for (int person = 0; person < 2; ++person) {
      const cv::Scalar skin = person == 0 ? cv::Scalar(125, 155, 205) : cv::Scalar(150, 180, 225);
      scene_.skins[person] = add(plain(random_, 256, skin, 4));
      scene_.heads[person] =
          add(head(random_, 256, skin, person == 0 ? cv::Scalar(25, 30, 40) : cv::Scalar(70, 120, 150)));
    }
    scene_.shirts[0] = add(collage(random_, 512, {70, 60, 50}, 260, 0.25, 1));
    scene_.shirts[1] = add(plaid(random_, 512, {190, 180, 160}));
    scene_.trousers[0] = add(blots(random_, 512, {70, 105, 110}));
    scene_.trousers[1] = add(collage(random_, 512, {110, 70, 45}, 180, 0.12, 1));
    scene_.shoes = add(plain(random_, 128, {45, 45, 50}, 8));
    const int wood = add(collage(random_, 1024, {120, 170, 205}, 60, 0.06, 0.6));
    for (int side = 0; side < 2; ++side) chair(stage.chairs[side], wood);
    if (stage.room) furnish(wood);
    if (stage.furniture) stand_in_front(wood);
    return std::move(scene_);
  }

 private:
  int add(const cv::Mat& image) {
    scene_.textures.emplace_back(image);
    return static_cast<int>(scene_.textures.size()) - 1;
  }

  /// A box by its centre on the ground plane, the height of its underside, its size and its turn about the vertical.
  Surface& box(double x, double y, double bottom, const Vector3d& size, int texture, double tile_m, double yaw = 0) {
    Surface s;
    s.half = size / 2;
    s.centre = Vector3d(x, y, bottom + s.half.z());
    s.A = Eigen::AngleAxisd(-yaw, Vector3d::UnitZ()).toRotationMatrix();
    s.texture = texture;
    s.tile_m = tile_m;
    for (int axis : {2, 1, 0}) s.shift[axis] = random_.uniform() * tile_m;
    scene_.surfaces.push_back(s);
    return scene_.surfaces.back();
  }

  void chair(const Stage::Chair& chair, int wood) {
    const double yaw = chair.heading - 1.5707963;
    const Matrix3d R = Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).toRotationMatrix();
    const auto part = [&](double dx, double dy, double bottom, const Vector3d& size) {
      const Vector3d at = R * Vector3d(dx, dy, 0);
      box(chair.x + at.x(), chair.y + at.y(), bottom, size, wood, 0.5, yaw);
    };
    part(0, 0, seat_height - 0.04, {0.42, 0.42, 0.04});
    part(0, -0.2, seat_height + 0.12, {0.42, 0.03, 0.3});
    for (const double dx : {-0.18, 0.18}) {
      part(dx, 0.18, 0, {0.03, 0.03, seat_height - 0.04});
      part(dx, -0.2, 0, {0.03, 0.03, seat_height + 0.12});
    }
  }

  void furnish(int wood) {
    // Tiles as large as the largest face they lie on: a pattern that comes again would be a trap for matching.
    const int wall = add(collage(random_, 2048, {200, 205, 210}, 700, 0.14, 0.7));
    const int brown = add(collage(random_, 1024, {110, 150, 180}, 150, 0.2, 0.6));
    const int grey = add(collage(random_, 1024, {140, 135, 130}, 170, 0.16, 0.6));
    const int screen = add(collage(random_, 512, {35, 30, 30}, 100, 0.3, 0.8));
    const int books = add(collage(random_, 1024, {90, 90, 110}, 350, 0.14, 0.8));

    Surface room;
    room.shape = Shape::room;
    room.half = Vector3d(4.2, 4.3, 1.6);
    room.centre = Vector3d(0, -0.4, 1.6);
    room.texture = wall;
    room.tile_m = 6.5;
    scene_.surfaces.push_back(room);
    box(0, -0.4, -0.02, {8.4, 8.6, 0.025}, grey, 3.5);
    for (int beam = 0; beam < 4; ++beam) box(0, 0.1 + 1.1 * beam, 2.75, {8.3, 0.18, 0.3}, brown, 4);

    // The desk: two plates on legs, with screens, books and small things.
    for (const double side : {-1.0, 1.0}) {
      box(0.82 * side, 0, 0.7, {1.6, 0.8, 0.04}, wood, 1);
      for (const double x : {0.1, 1.55}) {
        for (const double y : {-0.35, 0.35}) box(x * side, y, 0, {0.06, 0.06, 0.7}, grey, 0.6);
      }
      box(0.62 * side, 0.2, 0.86, {0.55, 0.05, 0.36}, screen, 0.6, 0.15 * side).absorbs_infrared = true;
      box(0.62 * side, 0.22, 0.74, {0.08, 0.08, 0.14}, grey, 0.3);
      box(0.62 * side, -0.12, 0.74, {0.42, 0.15, 0.02}, books, 0.7, 0.1);
    }
    for (int i = 0; i < 9; ++i) {
      const double yaw = random_.uniform(-0.6, 0.6);
      const Vector3d size{random_.uniform(0.06, 0.25), random_.uniform(0.06, 0.2), random_.uniform(0.02, 0.25)};
      const double y = random_.uniform(-0.3, 0.3), x = random_.uniform(-1.5, 1.5);
      box(x, y, 0.74, size, i % 2 == 0 ? books : brown, 0.5, yaw);
    }
    box(0, 0.56, 0, {3.5, 0.05, 1.22}, brown, 3.5);         // the partition behind the desk
    box(-2.75, 0.3, 0, {0.6, 0.9, 1.05}, books, 1.1, 0.2);  // low shelves and tables at the sides
    box(2.75, 0.1, 0, {0.55, 0.8, 0.85}, wood, 0.9, -0.2);
    box(2.75, 0.1, 0.85, {0.3, 0.25, 0.35}, books, 0.6, 0.4);
    box(-2.6, -1.3, 0, {0.5, 0.5, 0.6}, brown, 0.8, 0.3);
    box(-1.5, 2.3, 0, {1.3, 0.5, 1.95}, books, 1.3);  // cabinets at middle distance
    box(1.3, 2.6, 0, {1.1, 0.5, 2.1}, grey, 1.4);
    box(0.05, 3.2, 0, {0.9, 0.4, 1.6}, wood, 1.1);
    box(3.2, 1.8, 0, {0.35, 0.35, 3.1}, brown, 1.2);  // pillars
    box(-3.3, 1.2, 0, {0.35, 0.35, 3.1}, grey, 1.2);
  }

  /// A high table and a plant on a stand, narrower than a person, as near to the camera as the lanes allow.
  void stand_in_front(int wood) {
    const int pottery = add(collage(random_, 512, {95, 120, 165}, 160, 0.2, 0.8));
    const int foliage = add(blots(random_, 512, {70, 125, 75}));
    const double y = -2.24, table = random_.uniform(-0.42, -0.3), plant = random_.uniform(0.26, 0.38);
    box(table, y, 0, {0.26, 0.22, 0.03}, wood, 0.5);
    box(table, y, 0.03, {0.06, 0.06, 0.97}, wood, 1.2);
    box(table, y, 1, {0.42, 0.24, 0.03}, wood, 0.5);
    for (int i = 0; i < 3; ++i) {
      const double yaw = random_.uniform(-0.4, 0.4);
      const Vector3d size{random_.uniform(0.08, 0.12), 0.1, random_.uniform(0.08, 0.28)};
      box(table + 0.13 * (i - 1), y + random_.uniform(-0.04, 0.04), 1.03, size, pottery, 0.5, yaw);
    }
    box(plant, y, 0, {0.2, 0.2, 0.8}, pottery, 1);
    for (int leaf = 0; leaf < 16; ++leaf) {
      const double turn = 2.4 * leaf, length = random_.uniform(0.3, 0.55), open = random_.uniform(0.1, 0.6);
      const Vector3d out(std::cos(turn), std::sin(turn), 0);
      Surface s;
      s.shape = Shape::capsule;
      s.half = Vector3d(0.01, 0.01, length / 2);
      const Vector3d z = std::sin(open) * out + std::cos(open) * Vector3d::UnitZ();
      const Vector3d x = Vector3d::UnitZ().cross(out);
      s.centre = Vector3d(plant, y, 0.78) + length / 2 * z;
      s.A.row(0) = x.transpose() / 2.2;
      s.A.row(1) = z.cross(x).transpose();
      s.A.row(2) = z.transpose();
      s.texture = foliage;
      s.tile_m = 0.3;
      s.shift = Vector3d(0, 0, random_.uniform());
      scene_.surfaces.push_back(s);
    }
  }

  cfp::Random random_;
  Scene scene_;
};

}  // namespace synthetic
