# The defects of decoder.c, for the libraries here and the images of firmware/ports/stm32f4.
set(planted_defects length_unchecked escape_at_end flag_in_escape checksum_range off_by_one signed_length missing_reset
  integer_overflow state_kept endless_loop reply_skipped old_answered)
