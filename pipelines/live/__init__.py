"""The live scanner: from devices to a measured foot, and a virtual scanner without hardware."""
