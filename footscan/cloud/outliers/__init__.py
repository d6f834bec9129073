"""What in the cloud is not the foot, found by the evidence of other cameras, neighbouring frames and the glass."""
