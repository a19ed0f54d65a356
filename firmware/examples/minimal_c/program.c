/* The firmware of minimal_firmware.c as a program of its own: `--client program:minimal_program`. */
#include "firmware/tiltproof_client.h"
#include "firmware/tiltproof_program.h"

int main(void) { return tiltproof_program_run(); }
