/* A planner of somebody else's: brings every joint to an angle, by the IDL and Cyclone DDS's C interface alone.
 *
 *   foreign_planner DOMAIN ARM EPOCH Q1 Q2 ...      ends with 0 when the arm is there, with 3 after 60 s
 *
 * It hears the state, and answers each with a torque that excludes gravity. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dds/dds.h"
#include "hamel_v1.h"

enum { JOINTS = 64 };

static dds_entity_t checked(dds_entity_t made, const char *what)
{
  if (made < 0) {
    fprintf(stderr, "foreign_planner: %s: %s\n", what, dds_strretcode(-made));
    exit(2);
  }
  return made;
}

/* hamel meets on the loopback, where everybody is asked by unicast. */
static void loopback(unsigned domain)
{
  checked(dds_create_domain(domain,
                            "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/>"
                            "</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery>"
                            "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>50"
                            "</MaxAutoParticipantIndex><Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery>"
                            "</Domain></CycloneDDS>"),
          "domain");
}

/* A spring and a damper on each joint; true when the arm is at rest at its goal. */
static bool steer(const hamel_v1_ArmState *s, const double *goal, double *torque)
{
  bool there = true;
  for (uint32_t i = 0; i < s->position._length; i++) {
    const double error = goal[i] - s->position._buffer[i], speed = s->velocity._buffer[i];
    torque[i] = 12 * error - 12 * speed;
    there = there && fabs(error) < 0.01 && fabs(speed) < 0.05;
  }
  return there;
}

int main(int argc, char **argv)
{
  if (argc < 5 || argc - 4 > JOINTS) {
    fprintf(stderr, "usage: foreign_planner DOMAIN ARM EPOCH Q1 Q2 ...\n");
    return 2;
  }
  const unsigned domain = (unsigned)atoi(argv[1]), arm = (unsigned)atoi(argv[2]);
  double goal[JOINTS], torque[JOINTS];
  for (int i = 4; i < argc; i++) goal[i - 4] = atof(argv[i]);
  loopback(domain);
  const dds_entity_t me = checked(dds_create_participant(domain, NULL, NULL), "participant");
  const dds_entity_t states = checked(dds_create_topic(me, &hamel_v1_ArmState_desc, "hamel/v1/state", NULL, NULL), "topic");
  const dds_entity_t commands =
      checked(dds_create_topic(me, &hamel_v1_TorqueCommand_desc, "hamel/v1/command", NULL, NULL), "topic");
  const dds_entity_t in = checked(dds_create_reader(me, states, NULL, NULL), "reader");
  const dds_entity_t out = checked(dds_create_writer(me, commands, NULL, NULL), "writer");
  const dds_entity_t waitset = checked(dds_create_waitset(me), "waitset");
  dds_set_status_mask(in, DDS_DATA_AVAILABLE_STATUS);
  dds_waitset_attach(waitset, in, 0);

  int still = 0;
  const dds_time_t end = dds_time() + DDS_SECS(60);
  dds_time_t heard = dds_time();
  while (dds_time() < end) {
    dds_waitset_wait(waitset, NULL, 0, DDS_MSECS(100));
    void *sample = NULL;
    dds_sample_info_t info;
    while (dds_take(in, &sample, &info, 1, 1) == 1) {
      const hamel_v1_ArmState *s = sample;
      heard = dds_time();
      if (info.valid_data && s->arm == arm && s->position._length == (uint32_t)(argc - 4)) {
        still = steer(s, goal, torque) ? still + 1 : 0;
        hamel_v1_TorqueCommand c;
        memset(&c, 0, sizeof c);
        c.arm = arm;
        c.epoch = (uint64_t)atoll(argv[3]);
        c.state_incarnation = s->incarnation;
        c.step = s->step;
        c.t_s = s->t_s;
        c.torque._buffer = torque;
        c.torque._length = c.torque._maximum = s->position._length;
        c.planner_state = still > 100 ? hamel_v1_PLANNER_REACHED : hamel_v1_PLANNER_MOVING;
        checked(dds_write(out, &c), "write");
      }
      dds_return_loan(in, &sample, 1);
    }
    /* The run ends with the goal: nobody asks any more. */
    if (still > 100 && dds_time() - heard > DDS_MSECS(500)) {
      dds_delete(me);
      printf("there\n");
      return 0;
    }
  }
  fprintf(stderr, "foreign_planner: not there in 60 s\n");
  return 3;
}
