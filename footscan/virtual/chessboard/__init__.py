"""Pictures of a chessboard by the virtual scanner's cameras, with the laser off and on."""
