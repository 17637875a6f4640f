"""How a run gets to the disk: complete after every commit, whatever happens to its writer."""
