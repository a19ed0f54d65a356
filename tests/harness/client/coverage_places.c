/* Code whose compiler counts what is executed, and which counts that itself. */
unsigned own_counts[18];

#define PLACE(k) \
  void place_##k(void) { ++own_counts[k]; }
PLACE(0)
PLACE(1)
PLACE(2)
PLACE(3)
PLACE(4)
PLACE(5)
PLACE(6)
PLACE(7)
PLACE(8)
PLACE(9)
PLACE(10)
PLACE(11)
PLACE(12)
PLACE(13)

void branch(int left) {
  ++own_counts[14];
  if (left)
    ++own_counts[15];
  else
    ++own_counts[16];
  ++own_counts[17];
}
