// Reads or writes one topic of ROS 2 with its default middleware, eProsima's Fast DDS, as raw bytes, without ROS.
//
//   fastdds DOMAIN read TOPIC TYPE     prints each received message as a line of hexadecimal digits
//   fastdds DOMAIN write TOPIC TYPE    publishes each such line of its input, until the input ends
//
// It uses 127.0.0.1 without multicast, and knows no peer, so the other side has to find it.
// Debian 12: apt install libfastrtps-dev; g++ -O1 -o fastdds fastdds.cpp -lfastrtps -lfastcdr

#include <chrono>
#include <cstring>
#include <iostream>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

namespace fdds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

static const uint32_t kLargest = 2u << 20;

// A message of opaque bytes.
class Opaque : public fdds::TopicDataType {
 public:
  explicit Opaque(const std::string& name) {
    setName(name.c_str());
    m_typeSize = kLargest;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* from, rtps::SerializedPayload_t* to) override {
    const auto& text = *static_cast<std::string*>(from);
    if (text.size() > to->max_size) return false;
    std::memcpy(to->data, text.data(), text.size());
    to->length = static_cast<uint32_t>(text.size());
    to->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* from, void* to) override {
    static_cast<std::string*>(to)->assign(reinterpret_cast<const char*>(from->data), from->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void* of) override {
    const auto size = static_cast<uint32_t>(static_cast<std::string*>(of)->size());
    return [size] { return size; };
  }
  void* createData() override { return new std::string; }
  void deleteData(void* data) override { delete static_cast<std::string*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

class Printer : public fdds::DataReaderListener {
  void on_data_available(fdds::DataReader* reader) override {
    static const char* digits = "0123456789abcdef";
    std::string bytes, line;
    fdds::SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      line.clear();
      for (unsigned char byte : bytes) {
        line += digits[byte >> 4];
        line += digits[byte & 15];
      }
      std::cout << line << std::endl;
    }
  }
};

int main(int count, char** words) {
  if (count != 5) return 2;
  const std::string mode = words[2], topic_name = words[3], type_name = words[4];
  fdds::DomainParticipantQos here;
  auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  loopback->interfaceWhiteList = {"127.0.0.1"};
  here.transport().use_builtin_transports = false;
  here.transport().user_transports = {loopback};
  auto* participant = fdds::DomainParticipantFactory::get_instance()->create_participant(std::stoi(words[1]), here);
  if (participant == nullptr) return 1;
  fdds::TypeSupport type(new Opaque(type_name));
  type.register_type(participant);
  auto* topic = participant->create_topic(topic_name, type_name, fdds::TOPIC_QOS_DEFAULT);
  std::cerr << "ready" << std::endl;
  std::string line;
  if (mode == "read") {
    Printer printer;
    fdds::DataReaderQos as_ros = fdds::DATAREADER_QOS_DEFAULT;  // like rclcpp's default: reliable, with a queue of ten
    as_ros.reliability().kind = fdds::RELIABLE_RELIABILITY_QOS;
    as_ros.history().depth = 10;
    participant->create_subscriber(fdds::SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, as_ros, &printer);
    while (std::getline(std::cin, line)) {}
    std::_Exit(0);
  }
  fdds::DataWriterQos as_ros = fdds::DATAWRITER_QOS_DEFAULT;
  as_ros.history().depth = 1;
  as_ros.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  auto* writer = participant->create_publisher(fdds::PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, as_ros);
  while (std::getline(std::cin, line)) {
    std::string bytes;
    for (size_t at = 0; at + 1 < line.size(); at += 2) {
      const auto value = [](char digit) { return digit <= '9' ? digit - '0' : digit - 'a' + 10; };
      bytes += static_cast<char>(value(line[at]) * 16 + value(line[at + 1]));
    }
    writer->write(&bytes);
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  std::_Exit(0);
}
