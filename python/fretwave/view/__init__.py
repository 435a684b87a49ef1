"""What ParaView shows of a run."""
