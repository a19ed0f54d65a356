# The defects of decoder.c, for the libraries here and the images of firmware/ports/stm32f4.
set(planted_defects length_unchecked escape_at_end flag_in_escape checksum_range off_by_one signed_length missing_reset
  integer_overflow state_kept endless_loop reply_skipped old_answered)
# Those of cobs_client.c.
set(planted_cobs_defects code_beyond_end full_block length_unchecked check_ignored range_unchecked state_kept reset_missing)
