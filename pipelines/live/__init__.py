"""The live scanner: from devices to a measured foot, and a world without hardware to try it in."""
