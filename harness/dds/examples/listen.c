/* Listens to a flight of tiltproof on the bus, as any program can: prints phases, events, the score, and the vehicle
 * once a second. It needs Cyclone DDS and tiltproof.idl, nothing else of tiltproof.
 *
 *   listen DOMAIN TAG [INTERFACE]      DOMAIN and TAG: in run.json, under "bus" of the flight
 *
 * It only reads. A flight neither waits for it nor hears it. */
#include <dds/dds.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <tiltproof.h> /* idlc makes it of tiltproof.idl */

enum { kBatch = 16, kDomainMax = 230 };

/* Alone on this machine, over loopback without multicast, or on a network interface. Who has another tag is not seen. */
static dds_entity_t Join(uint32_t domain, const char* tag, const char* interface) {
  static const char* const kLocal =
      "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" "
      "multicast=\"false\"/>"
      "</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
      "</ParticipantIndex><MaxAutoParticipantIndex>100</MaxAutoParticipantIndex><Peers><Peer "
      "address=\"127.0.0.1\"/>"
      "</Peers><Tag>%s</Tag></Discovery></Domain></CycloneDDS>";
  static const char* const kNetwork =
      "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"%s\"/></Interfaces>"
      "<AllowMulticast>spdp</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
      "<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex><Tag>%s</Tag></Discovery></Domain></CycloneDDS>";
  char xml[2048];
  if (interface == NULL) {
    snprintf(xml, sizeof xml, kLocal, tag);
  } else {
    snprintf(xml, sizeof xml, kNetwork, interface, tag);
  }
  const dds_entity_t created = dds_create_domain(domain, xml);
  if (created < 0) return created;
  return dds_create_participant(domain, NULL, NULL);
}

/* The topic's reader. Standing facts and events come to latecomers, too. */
static dds_entity_t Read(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                         dds_durability_kind_t durability, dds_history_kind_t history) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, history, 1);
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  const dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

/* Texts come from programs that may be anything: what could command a terminal is not printed. */
static const char* Plain(const char* text) {
  static char plain[8][512];
  static int next;
  char* to = plain[next = (next + 1) % 8];
  size_t i = 0;
  for (; text[i] != '\0' && i + 1 < sizeof plain[0]; ++i)
    to[i] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
  to[i] = '\0';
  return to;
}

static void PrintState(const void* sample) {
  static const char* const kPhases[] = {"idle", "prepared", "armed", "running", "finished", "failed"};
  const tiltproof_RunState* state = sample;
  printf("state  %10.3f s  %s %s %s\n", (double)state->time_ns * 1e-9, Plain(state->node_id),
         kPhases[state->phase], Plain(state->text));
}
static void PrintEvent(const void* sample) {
  const tiltproof_RunEvent* event = sample;
  printf("event  %10.3f s  %s %s: %s\n", (double)event->time_ns * 1e-9, Plain(event->node_id),
         Plain(event->kind), Plain(event->text));
}
static void PrintScore(const void* sample) {
  const tiltproof_Score* score = sample;
  printf("score  %s %s %s\n", Plain(score->scenario), Plain(score->verdict), Plain(score->reason));
}
static void PrintPlant(const void* sample) {
  static int64_t next_ns;
  const tiltproof_PlantState* plant = sample;
  if (plant->time_ns < next_ns) return;
  next_ns = plant->time_ns + 1000000000;
  if (plant->state._length < 3) return;
  printf("plant  %10.3f s  x %.3f y %.3f z %.3f m\n", (double)plant->time_ns * 1e-9, plant->state._buffer[0],
         plant->state._buffer[1], plant->state._buffer[2]);
}

static void Take(dds_entity_t reader, void (*print)(const void*)) {
  void* samples[kBatch] = {NULL};
  dds_sample_info_t infos[kBatch];
  int count;
  while ((count = dds_take(reader, samples, infos, kBatch, kBatch)) > 0) {
    for (int i = 0; i < count; ++i)
      if (infos[i].valid_data) print(samples[i]);
    dds_return_loan(reader, samples, count);
  }
  fflush(stdout);
}

int main(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    fprintf(stderr, "usage: listen DOMAIN TAG [INTERFACE]\n");
    return 2;
  }
  char* end;
  const unsigned long domain = strtoul(argv[1], &end, 10);
  if (*argv[1] < '0' || *argv[1] > '9' || *end != '\0' || domain > kDomainMax) {
    fprintf(stderr, "listen: a domain is a number from 0 to %d, not %s\n", kDomainMax, argv[1]);
    return 2;
  }
  const dds_entity_t us = Join((uint32_t)domain, argv[2], argc == 4 ? argv[3] : NULL);
  if (us < 0) {
    fprintf(stderr, "listen: cannot join domain %s: %s\n", argv[1], dds_strretcode(us));
    return 1;
  }
  const dds_entity_t states = Read(us, &tiltproof_RunState_desc, "tiltproof/run_state",
                                   DDS_DURABILITY_TRANSIENT_LOCAL, DDS_HISTORY_KEEP_LAST);
  const dds_entity_t events = Read(us, &tiltproof_RunEvent_desc, "tiltproof/run_event",
                                   DDS_DURABILITY_TRANSIENT_LOCAL, DDS_HISTORY_KEEP_ALL);
  const dds_entity_t scores = Read(us, &tiltproof_Score_desc, "tiltproof/score",
                                   DDS_DURABILITY_TRANSIENT_LOCAL, DDS_HISTORY_KEEP_LAST);
  const dds_entity_t plants = Read(us, &tiltproof_PlantState_desc, "tiltproof/plant_state",
                                   DDS_DURABILITY_VOLATILE, DDS_HISTORY_KEEP_LAST);
  const dds_entity_t waitset = dds_create_waitset(us);
  const dds_entity_t readers[] = {states, events, scores, plants};
  for (int i = 0; i < 4; ++i) {
    dds_set_status_mask(readers[i], DDS_DATA_AVAILABLE_STATUS);
    dds_waitset_attach(waitset, readers[i], 0);
  }
  printf("listening\n");
  for (;;) {
    dds_waitset_wait(waitset, NULL, 0, DDS_INFINITY);
    Take(states, PrintState);
    Take(events, PrintEvent);
    Take(plants, PrintPlant);
    Take(scores, PrintScore);
  }
}
