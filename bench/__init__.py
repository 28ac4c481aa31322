"""Claims about speed, memory and accuracy, each with the code that measures it (`make bench`)."""
