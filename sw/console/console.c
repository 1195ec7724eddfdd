// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "console/console.h"

#include "console/console_items.h"
#include "console/format.h"
#include "control/placement.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/uart.h"

SMALL_CODE_BEGIN

#define RING_LENGTH 256u
#define LINE_LENGTH 80u
#define WORDS_MAX 4u

// Receive ring between the UART's handler (head) and the main loop (tail), and the line being collected. Bytes that find
// the ring full are lost; so are all that come until the main loop has emptied it and knows where they are missing.
static struct {
  volatile uint32_t head;
  volatile uint32_t tail;
  volatile bool losing;
  volatile bool after_end;      // nothing but blanks, kept or lost, since the end of a line
  volatile uint32_t lost_ends;  // lines that ended among the lost bytes
  volatile uint32_t lost_bytes; // since boot
  line_t line;
  char text[LINE_LENGTH];
  uint8_t ring[RING_LENGTH];
} console;

void console_init(void) {
  console.head = 0;
  console.tail = 0;
  console.losing = false;
  console.after_end = true;
  console.lost_ends = 0;
  console.lost_bytes = 0;
  console.line = (line_t){.text = console.text, .size = LINE_LENGTH};
}

static void receive(uint8_t byte) {
  const uint32_t head = console.head;
  const bool end = byte == '\r' || byte == '\n';
  const bool blank = byte == ' ' || byte == '\t';
  if (!console.losing && head - console.tail < RING_LENGTH) {
    console.ring[head % RING_LENGTH] = byte;
    console.head = head + 1u;
  } else {
    console.losing = true;
    console.lost_bytes++;
    console.lost_ends += (end && !console.after_end) ? 1u : 0u;
  }
  console.after_end = end || (blank && console.after_end);
}

COLD void console_receive(uint32_t word) {
  const uint32_t count = uart_text_length(word);
  for (uint32_t i = 0; i < count; i++) {
    receive(uart_text(word, i));
  }
}

static void console_put(const char *text) { line_put(&console.line, text); }

static void put_u32(uint32_t value) {
  char text[FORMAT_LENGTH];
  format_u32(text, value);
  console_put(text);
}

static void request(app_t *app, request_t wanted) {
  const uint32_t state = critical_enter();
  drive_request(&app->drive, wanted);
  critical_leave(state);
}

static const char *command_help(const app_t *app) {
  console_put(
      "help | status | get [name] | set name value | start | stop [now] | faults | clear | stats\n"
      "settings:");
  items_list_settable(app, &console.line);
  console_put("\n");
  return 0;
}

static const char *command_status(app_t *app) {
  static const char *const shown[] = {"state", "fault", "speed_rpm", "measured_rpm",
                                      "duty",  "vdc_v", "idc_a",     "motor_a"};
  for (uint32_t i = 0; i < sizeof shown / sizeof shown[0]; i++) {
    (void)items_print(app, &console.line, shown[i]);
  }
  return 0;
}

static void put_channel(uint32_t channel) {
  if (channel >= (uint32_t)TRIP_CHANNEL_IDC) {
    console_put((channel == (uint32_t)TRIP_CHANNEL_VDC) ? "vdc" : "idc");
  } else {
    const char name[] = {'i', (char)('a' + (char)channel), '\0'};
    console_put(name);
  }
}

static const char *command_faults(const app_t *app) {
  const fault_log_t *log = &app->drive.log;
  const uint32_t shown = (log->count < FAULT_LOG_LENGTH) ? log->count : FAULT_LOG_LENGTH;
  console_put("now ");
  console_put(fault_name(app->drive.fault));
  console_put("\n");
  if (app->drive.fault == FAULT_START_FAILED) {
    (void)items_print(app, &console.line, "phase");
  }
  for (uint32_t i = 0; i < shown; i++) {
    const fault_entry_t *entry = &log->entry[(log->count - 1u - i) % FAULT_LOG_LENGTH];
    console_put("fault ");
    console_put(fault_name(entry->fault));
    console_put(" tick ");
    put_u32(entry->tick);
    console_put("\n");
  }
  for (uint32_t i = 0; i < 8u; i++) {
    const trip_record_t record = chip_trip_record(i);
    if (record.valid) {
      console_put("trip ");
      console_put(fault_name(fault_of_trip(record.causes)));
      console_put(" clock ");
      put_u32(record.stamp);
      console_put(" channel ");
      put_channel(record.channel);
      console_put(" code ");
      put_u32(record.code_lsb);
      console_put("\n");
    }
  }
  return 0;
}

static void put_row(const char *name, const uint32_t *values, uint32_t count) {
  console_put(name);
  for (uint32_t i = 0; i < count; i++) {
    console_put(" ");
    put_u32(values[i]);
  }
  console_put("\n");
}

static const char *command_stats(const app_t *app) {
  for (uint32_t h = 0; h < HANDLER_COUNT; h++) {
    const uint32_t state = critical_enter();
    const cycles_t cycles = app->telemetry->handler[h];
    critical_leave(state);
    if (cycles.count == 0u) {
      continue;
    }
    const uint32_t values[] = {cycles.min, cycles_mean(&cycles), cycles.max, cycles.count};
    console_put("isr ");
    put_row(handler_name((handler_t)h), values, 4);
  }
  const uint32_t overruns[] = {chip_tick_overruns(), chip_all_overruns()};
  put_row("overruns", overruns, 2);
  const line_t *line = &console.line;
  const uint32_t lost[] = {uart_overruns(), uart_frame_errors(), console.lost_bytes};
  const uint32_t refused[] = {line->lost_lines, line->too_long_lines, line->checksum_lines};
  put_row("bytes_lost", lost, 3);
  put_row("lines_refused", refused, 3);
  return 0;
}

static const char *command_start(app_t *app) {
  if (app->drive.order.state != STATE_READY) {
    return "not ready";
  }
  if (app->drive.settings.target_rpm == 0) {
    return "speed_rpm is 0";
  }
  request(app, REQUEST_START);
  return 0;
}

static const char *command_stop(app_t *app, uint32_t words, char **word) {
  if (words > 1u && !text_equal(word[1], "now")) {
    return "stop [now]";
  }
  request(app, (words > 1u) ? REQUEST_STOP_NOW : REQUEST_STOP);
  return 0;
}

static const char *command_clear(app_t *app) {
  if (app->drive.order.state != STATE_FAULT) {
    return "no fault to clear";
  }
  request(app, REQUEST_CLEAR);
  return 0;
}

// Runs one command; 0 or the text of its error.
static const char *execute(app_t *app, uint32_t words, char **word) {
  const char *name = word[0];
  if (text_equal(name, "help")) {
    return command_help(app);
  }
  if (text_equal(name, "faults")) {
    return command_faults(app);
  }
  if (text_equal(name, "stats")) {
    return command_stats(app);
  }
  if (app->drive.p == 0) {
    // Without parameters there is nothing to start or set, and no scale to print with.
    if (text_equal(name, "status") || (text_equal(name, "get") && words == 2u)) {
      console_put("state init\nfault ");
      console_put(fault_name(app->drive.fault));
      console_put("\n");
      return 0;
    }
    return "no valid parameters";
  }
  if (text_equal(name, "status")) {
    return command_status(app);
  }
  if (text_equal(name, "get")) {
    return (words == 1u) ? items_print_all(app, &console.line) : (items_print(app, &console.line, word[1]) ? 0 : "unknown name");
  }
  if (text_equal(name, "set")) {
    return (words == 3u) ? items_set(app, word[1], word[2]) : "set name value";
  }
  if (text_equal(name, "start")) {
    return command_start(app);
  }
  if (text_equal(name, "stop")) {
    return command_stop(app, words, word);
  }
  if (text_equal(name, "clear")) {
    return command_clear(app);
  }
  return "unknown command, try help";
}

// Words of a line, at most WORDS_MAX of them; of none the first is empty.
static uint32_t split(char *line, char **word) {
  uint32_t words = 0;
  bool inside = false;
  for (; *line != '\0'; line++) {
    if (*line == ' ' || *line == '\t') {
      *line = '\0';
      inside = false;
    } else if (!inside) {
      inside = true;
      if (words == WORDS_MAX) {
        return WORDS_MAX + 1u;
      }
      word[words] = line;
      words++;
    }
  }
  if (words == 0u) {
    word[0] = line;
  }
  return words;
}

// Not part of the main loop's frame, which lies above those of all interrupts: the deeper the stack, the more of its lines
// in the data cache are those of the telemetry (sim/fluxlock/generate/memory.py).
COLD static void run_line(app_t *app) {
  char *word[WORDS_MAX];
  const char *error = line_check(&console.line);
  if (error == 0) {
    const uint32_t words = split(console.text, word);
    drive_heard(&app->drive);
    error = (words > WORDS_MAX) ? "too many words" : execute(app, words, word);
  }
  line_answer(&console.line, error);
}

// true: it ended a line, which has its answer.
static bool take(app_t *app, uint8_t byte) {
  const bool whole = line_add(&console.line, byte);
  if (whole) {
    run_line(app);
  }
  return whole;
}

// The ring is empty: the lost bytes are missing here. A line of them, then what of a line may have begun.
COLD static void take_lost(app_t *app) {
  const uint32_t state = critical_enter();
  const bool end = console.lost_ends != 0u;
  const bool begun = !end && !console.after_end;
  console.lost_ends -= end ? 1u : 0u;
  console.losing = end;
  critical_leave(state);
  if (end || begun) {
    (void)take(app, UART_LOST);
  }
  if (end) {
    (void)take(app, '\n');
  }
}

// A round answers one line: as many as the ring holds would take longer than the main loop may.
void console_poll(app_t *app) {
  bool whole = false;
  while (!whole && console.tail != console.head) {
    const uint8_t byte = console.ring[console.tail % RING_LENGTH];
    console.tail = console.tail + 1u;
    whole = take(app, byte);
  }
  // In this order: once bytes are being lost none enters the ring.
  if (!whole && console.losing && console.tail == console.head) {
    take_lost(app);
  }
}

bool console_waits(void) { return console.losing || console.tail != console.head; }

SMALL_CODE_END
