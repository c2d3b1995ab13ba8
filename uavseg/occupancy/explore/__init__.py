"""Where a robot looks next: views of frontiers, the order of them, and drives through simulated scenes."""
