// SDF files with sensors: what is read, and what is wrong with them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "plant/plant.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Two rotors that are fixed to a body, `arm` turned about z, and one on a hinge, `tilt`.
class SensorFile : public ::testing::Test {
 protected:
  SensorFile() { std::filesystem::create_directories(folder_); }
  ~SensorFile() override { std::filesystem::remove_all(folder_); }

  static std::string Body(const std::string& name, const std::string& pose, const std::string& sensors) {
    return "<link name='" + name + "'><pose>" + pose +
           "</pose><inertial><mass>0.5</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia>"
           "</inertial><collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>\n" +
           sensors + "</link>";
  }
  // Sensors on each link; their first line is line 2, 3 and 4 of the file.
  VehicleModel Load(const std::string& on_body, const std::string& on_arm = "",
                    const std::string& on_tilt = "", const std::string& elements = "",
                    const std::string& version = "1.9") {
    const auto rotor = [](const std::string& link, int direction) {
      return "<tiltproof:rotor link='" + link + "' direction='" + std::to_string(direction) +
             "' drag_ratio_m='0.01' force_max_n='20'/>";
    };
    std::ofstream(file_) << "<sdf version='" + version + "'><model name='vehicle'>"
                         << Body("body", "0 0 0 0 0 0", on_body)
                         << Body("arm", "0.3 0 0.1 0 0 1.5707963267948966", on_arm)
                         << Body("tilt", "-0.3 0 0.1 0 0 0", on_tilt)
                         << "<joint name='fix' type='fixed'><parent>body</parent><child>arm</child></joint>"
                            "<joint name='hinge' type='revolute'><parent>body</parent><child>tilt</child>"
                            "<axis><xyz>1 0 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>"
                            "</joint><tiltproof:vehicle xmlns:tiltproof='urn:tiltproof:vehicle:1'>"
                            "<tiltproof:base link='body'/><tiltproof:servo joint='hinge' torque_max_nm='2'/>"
                         << rotor("arm", 1) << rotor("tilt", -1) << "\n"
                         << elements << "</tiltproof:vehicle></model></sdf>";
    warnings_.clear();
    return LoadVehicle(file_, {}, warnings_);
  }
  std::string Error(const std::string& on_body, const std::string& on_arm = "",
                    const std::string& elements = "") {
    try {
      Load(on_body, on_arm, "", elements);
      ADD_FAILURE() << "loaded";
      return {};
    } catch (const VehicleError& error) {
      return error.what();
    }
  }
  std::string At(int line) const { return file_.string() + ":" + std::to_string(line) + ": "; }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  ("tiltproof-sensors-" + std::to_string(::getpid()) + "-" +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path file_ = folder_ / "vehicle.sdf";
  std::vector<std::string> warnings_;
};

std::string NoiseXml(const std::string& content) { return "<noise type='gaussian'>" + content + "</noise>"; }
std::string SensorXml(const std::string& type, const std::string& name, const std::string& content) {
  return "<sensor name='" + name + "' type='" + type + "'>" + content + "</sensor>";
}

TEST_F(SensorFile, RatesNoisePosesAndLatency) {
  const std::string imu =
      SensorXml("imu", "imu0",
                "<always_on>1</always_on><update_rate>250</update_rate><pose>0.1 0.2 0.3 0 0 0</pose><imu>"
                "<angular_velocity><y>" +
                    NoiseXml("<mean>0.1</mean><stddev>0.2</stddev><bias_mean>0.3</bias_mean><bias_stddev>0.4"
                             "</bias_stddev><dynamic_bias_stddev>0.5</dynamic_bias_stddev>"
                             "<dynamic_bias_correlation_time>600</dynamic_bias_correlation_time>") +
                    "</y></angular_velocity><linear_acceleration><z>" + NoiseXml("<stddev>0.7</stddev>") +
                    "</z></linear_acceleration></imu>");
  const std::string others =
      SensorXml("magnetometer", "compass",
                "<magnetometer><x>" + NoiseXml("<stddev>1e-7</stddev>") + "</x></magnetometer>") +
      SensorXml("air_pressure", "baro",
                "<update_rate>50</update_rate><air_pressure><reference_altitude>100</reference_altitude>"
                "<pressure><noise type='gaussian_quantized'><stddev>3</stddev><precision>2</precision>"
                "</noise></pressure></air_pressure>") +
      SensorXml("navsat", "gnss",
                "<navsat><position_sensing><horizontal>" + NoiseXml("<stddev>1</stddev>") +
                    "</horizontal><vertical>" + NoiseXml("<stddev>2</stddev>") +
                    "</vertical></position_sensing><velocity_sensing><horizontal>" +
                    NoiseXml("<stddev>0.1</stddev>") + "</horizontal></velocity_sensing></navsat>");
  const VehicleModel model =
      Load(others, imu, "",
           "<tiltproof:sensor name='gnss' latency_s='0.2'/>"
           "<tiltproof:world latitude_deg='-33.9' longitude_deg='151.2' elevation_m='20' "
           "magnetic_field_t='1e-6 2e-5 5e-5'/>");
  EXPECT_TRUE(warnings_.empty());
  ASSERT_EQ(model.sensors.size(), 4U);
  const Sensor& compass = model.sensors[0];
  EXPECT_EQ(compass.kind, SensorKind::kMagnetometer);
  EXPECT_EQ(compass.rate_hz, 0);
  EXPECT_EQ(compass.noise[0].stddev, 1e-7);
  EXPECT_EQ(model.sensors[1].altitude_m, 100);
  EXPECT_EQ(model.sensors[1].noise[0].stddev, 3);
  EXPECT_EQ(model.sensors[1].noise[0].quantum, 2);
  const Sensor& gnss = model.sensors[2];
  EXPECT_EQ(gnss.latency_s, 0.2);
  EXPECT_EQ(gnss.noise[1].stddev, 1);
  EXPECT_EQ(gnss.noise[2].stddev, 2);
  EXPECT_EQ(gnss.noise[4].stddev, 0.1);
  EXPECT_EQ(gnss.noise[5].stddev, 0);
  const Sensor& read = model.sensors[3];
  EXPECT_EQ(read.name, "imu0");
  EXPECT_EQ(read.rate_hz, 250);
  EXPECT_EQ(read.latency_s, 0);
  // The arm is turned by a quarter about z.
  EXPECT_NEAR((read.p_BS_m - Vector3d(0.3 - 0.2, 0.1, 0.4)).norm(), 0, 1e-12);
  EXPECT_NEAR((read.R_BS * Vector3d::UnitX() - Vector3d::UnitY()).norm(), 0, 1e-12);
  EXPECT_EQ(read.noise[2].stddev, 0.7);
  const SensorNoise& noise = read.noise[4];
  EXPECT_EQ(noise.mean, 0.1);
  EXPECT_EQ(noise.stddev, 0.2);
  EXPECT_EQ(noise.bias_mean, 0.3);
  EXPECT_EQ(noise.bias_stddev, 0.4);
  EXPECT_EQ(noise.walk_density, 0.5);
  EXPECT_EQ(noise.walk_time_s, 600);
  EXPECT_EQ(model.surroundings.latitude_deg, -33.9);
  EXPECT_EQ(model.surroundings.longitude_deg, 151.2);
  EXPECT_EQ(model.surroundings.elevation_m, 20);
  EXPECT_EQ(model.surroundings.magnetic_field_t, Vector3d(1e-6, 2e-5, 5e-5));
}

TEST_F(SensorFile, OldFilesCallTheReceiverGps) {
  const VehicleModel model =
      Load(SensorXml("gps", "old",
                     "<gps><position_sensing><horizontal>" + NoiseXml("<stddev>1.25</stddev>") +
                         "</horizontal></position_sensing></gps>"),
           "", "", "", "1.6");
  ASSERT_EQ(model.sensors.size(), 1U);
  EXPECT_EQ(model.sensors[0].kind, SensorKind::kGnss);
  EXPECT_EQ(model.sensors[0].noise[0].stddev, 1.25);
}

TEST_F(SensorFile, OnAHingeASensorIsIgnoredWithAWarning) {
  const VehicleModel model = Load("", "", SensorXml("imu", "shaky", ""));
  EXPECT_TRUE(model.sensors.empty());
  EXPECT_THAT(warnings_, ::testing::Contains(AllOf(HasSubstr(At(4)), HasSubstr("\"shaky\""),
                                                   HasSubstr("'tilt' moves against the base"))));
}

TEST_F(SensorFile, OtherTypesAreOneWarning) {
  const VehicleModel model = Load(SensorXml("camera", "eye", "") + SensorXml("altimeter", "height", ""));
  EXPECT_TRUE(model.sensors.empty());
  EXPECT_EQ(warnings_.size(), 2U);
  EXPECT_THAT(warnings_, ::testing::Contains(AllOf(HasSubstr("\"eye\""), HasSubstr("'camera'"))));
  EXPECT_THAT(warnings_, ::testing::Contains(AllOf(HasSubstr("\"height\""), HasSubstr("'altimeter'"))));
}

TEST_F(SensorFile, ANoiseInGaussIsNoticed) {
  const std::string noise = NoiseXml("<stddev>1e-4</stddev>");
  Load(SensorXml("magnetometer", "compass", "<magnetometer><y>" + noise + "</y></magnetometer>"));
  EXPECT_THAT(warnings_,
              ::testing::Contains(AllOf(HasSubstr(At(2) + "sensor 'compass'"),
                                        HasSubstr("0.0001 T is larger than the field, 4.85e-05 T"))));
}

TEST_F(SensorFile, BadNumbersAreErrorsWithTheirLine) {
  const auto imu = [](const std::string& content) { return SensorXml("imu", "imu0", content); };
  const auto noise = [&](const std::string& content) {
    return imu("<imu><linear_acceleration><x>" + NoiseXml(content) + "</x></linear_acceleration></imu>");
  };
  EXPECT_THAT(Error(imu("<update_rate>fast</update_rate>")),
              HasSubstr(At(2) + "sensor 'imu0': <update_rate> must be a number in [0, 1000000], is 'fast'"));
  EXPECT_THAT(Error("", imu("<update_rate>-1</update_rate>")), HasSubstr(At(3) + "sensor 'imu0'"));
  EXPECT_THAT(Error(noise("<stddev>0,1</stddev>")),
              HasSubstr("<stddev> must be a number that is not negative, is '0,1'"));
  EXPECT_THAT(Error(noise("<stddev>-0.1</stddev>")), HasSubstr("is '-0.1'"));
  EXPECT_THAT(Error(noise("<mean>nan</mean>")), HasSubstr("<mean> must be a number, is 'nan'"));
  EXPECT_THAT(Error(noise("<bias_mean>pi/2</bias_mean>")), HasSubstr("is 'pi/2'"));
  EXPECT_THAT(Error(imu("<pose>0 0 0 0 0</pose>")), HasSubstr("<pose> must be six numbers"));
  EXPECT_THAT(Error(SensorXml("air_pressure", "baro",
                              "<air_pressure><reference_altitude>99999</reference_altitude></air_pressure>")),
              HasSubstr("[-1000, 18000], is '99999'"));
}

TEST_F(SensorFile, TwoSensorsOfOneName) {
  EXPECT_THAT(Error(SensorXml("imu", "same", ""), SensorXml("magnetometer", "same", "")),
              HasSubstr(At(3) + "a second sensor 'same': rename one of them"));
  // Signals spell both names alike.
  EXPECT_THAT(Error(SensorXml("imu", "a", "") + SensorXml("imu", "b.1", "") + SensorXml("imu", "b-1", "")),
              HasSubstr("two sensors have the signal 'acc_b_1_x_m_s2': rename one of them"));
}

TEST_F(SensorFile, MistakesInTheElements) {
  const std::string imu = SensorXml("imu", "imu0", ""), baro = SensorXml("air_pressure", "baro", "");
  const auto error = [&](const std::string& elements) { return Error(imu + baro, "", elements); };
  EXPECT_THAT(error("<tiltproof:sensor name='imu1' latency_s='0.1'/>"),
              HasSubstr(At(5) + "<tiltproof:sensor>: the vehicle has no sensor 'imu1'; it has imu0, baro"));
  EXPECT_THAT(Error("", "", "<tiltproof:sensor name='imu1'/>"), HasSubstr("'imu1'; it has none"));
  EXPECT_THAT(error("<tiltproof:sensor name='imu0' latency_s='-1'/>"), HasSubstr("[0, 10]"));
  EXPECT_THAT(error("<tiltproof:sensor latency_s='1'/>"), HasSubstr("needs the attribute 'name'"));
  EXPECT_THAT(error("<tiltproof:sensor name='imu0' delay='1'/>"), HasSubstr("no attribute 'delay'"));
  EXPECT_THAT(error("<tiltproof:world latitude_deg='91'/>"), HasSubstr("[-90, 90]"));
  EXPECT_THAT(error("<tiltproof:world magnetic_field_t='0.2 0 0.4'/>"), HasSubstr("is in tesla"));
  EXPECT_THAT(error("<tiltproof:world magnetic_field_t='0.2 0'/>"), HasSubstr("three numbers"));
  EXPECT_THAT(error("<tiltproof:world/><tiltproof:world/>"), HasSubstr("one <tiltproof:world>"));
}

TEST_F(SensorFile, TheyFlyWithTheVehicle) {
  const VehicleModel model = Load(SensorXml("air_pressure", "baro", "") + SensorXml("imu", "imu0", ""));
  EXPECT_THAT(model.signals().measured.size(), 7U);
  Plant plant(model, {.step_ns = 4 * kNsPerMs});
  plant.Reset({0, 0, 5}, {0, 0, 0});
  std::vector<double> sensors(model.signals().sensors.size()), state(model.signals().states.size());
  plant.ReadSensors(sensors);
  plant.State(state);
  // The states come first.
  EXPECT_TRUE(std::equal(state.begin(), state.end(), sensors.begin()));
  EXPECT_NEAR(sensors[state.size()], StandardPressure_pa(493), 1e-9);
  EXPECT_NEAR(sensors.back(), 0, 1e-12);
}

}  // namespace
}  // namespace tiltproof::plant
