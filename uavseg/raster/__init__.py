"""Where pixels are: files become grey tiles that know where they lie."""
